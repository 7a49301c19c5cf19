"""Inverse kinematics: poses of a calibrated skeleton from its markers, and what follows from them.

`root_outward` poses limb after limb in closed form, `poses` fits the whole chain by Gauss-Newton steps and gives
covariances, and `loop_closure` keeps kinematic loops closed. Scripts call `inverse_kinematics`. `motion` computes joint
angles and their ranges.
"""
