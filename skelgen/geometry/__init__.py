"""Pure functions on arrays: absolute orientation, rotations."""
