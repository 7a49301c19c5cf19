"""The desktop window (to come); the only importer of PySide6."""
