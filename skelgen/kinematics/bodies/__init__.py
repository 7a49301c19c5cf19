"""Rigid bodies: `shape` finds a limb's shape and poses from markers with gaps, `rigid_body` the shape in a normal form
with its covariance, and `relative_poses` the poses of one body relative to another.
"""
