"""The project file ``.skelgen``: its archive, values as plain data, and checks of both."""
