"""Pure functions on arrays: absolute orientation, rotations.

May change with every version; scripts import what they need from `skelgen`.
"""
