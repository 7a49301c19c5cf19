"""Joints between two bodies with poses: their rotations, closed forms, maximum likelihood fits and types.

`rotations` says how each type of joint turns, `joint_model` adds its position, `closed_form` gives first estimates,
`fit` refines them, `joint_type` chooses the simplest type that explains the motion, and `observability` says in words
what the motion does not determine. `angles` computes the angles of fitted joints.
"""
