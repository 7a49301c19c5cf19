"""Soft tissue: markers that move on their limb in proportion to the rotations of its joints, fitted with the chain."""
