"""The project file ``.skelgen``: its archive, values as plain data, checks of both, and the recording it refers to."""
