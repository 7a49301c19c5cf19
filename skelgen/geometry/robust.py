"""Spread that a few wild values do not spoil."""

SIGMA_OF_MEDIAN = 1.4826
"""Standard deviation of normal numbers with a median absolute deviation of 1."""
