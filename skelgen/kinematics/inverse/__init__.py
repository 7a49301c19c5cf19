"""Inverse kinematics: poses of a known skeleton from its markers.

`root_outward` poses limb after limb in closed form, `poses` fits the whole chain by Gauss-Newton steps and gives
covariances, `loop_closure` keeps kinematic loops closed, and `inverse_kinematics` is what scripts call.
"""
