"""The thesis' methods (Schönauer 2007): they run where they are asked for, and where rigidity has no answer.

Two cases have none: rigidity finds another number of limbs than is stated, which spectral clustering then gives; and
both limbs of a joint have too few markers for a pose, so that conjugate gradients place it.
"""
