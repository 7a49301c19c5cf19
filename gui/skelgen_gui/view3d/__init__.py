"""The 3-D view: a frame of the project, projected and painted without a graphics card."""
