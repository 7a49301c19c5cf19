"""The four stages: labels, limbs, joints, skeleton."""
