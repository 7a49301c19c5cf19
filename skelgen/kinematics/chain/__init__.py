"""The articulated chain: rigid limbs in a tree with markers on them.

`chain` holds limbs and poses, `articulation` what the joints allow, `normal_equations` how poses and constants are
tied in least squares, and `schur_complement` least squares with constants and unknowns of each frame.
"""
