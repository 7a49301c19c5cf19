"""The thesis' methods (Schönauer 2007), which run only where they are asked for."""
