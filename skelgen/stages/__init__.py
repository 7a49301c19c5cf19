"""The four stages: labels, limbs, joints, skeleton.

May change with every version; scripts import what they need from `skelgen`.
"""
