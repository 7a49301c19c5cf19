"""The desktop window; the only importer of PySide6."""
