"""Corrections by hand: what can be said of a selection, the menu that says it, and the list of what was said."""
