"""Calibration of a whole chain by maximum likelihood, with the covariances of what it gives.

`calibrate` fits trees, `closed_loops` fits them again with their kinematic loops closed, `limb_errors` and
`uncertainty` say how sure the constants and the joints in each frame are, compared with the Cramer-Rao bound;
`joint_prior` draws joints back that no motion determines.
"""
