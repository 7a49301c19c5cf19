"""What pictures of a project show, as plain numbers and texts: the report writes it as SVG, the window paints it."""
