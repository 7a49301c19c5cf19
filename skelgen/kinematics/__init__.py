"""Joint models fitted on limb poses."""
