"""What the user states of labels: identities of points as constraints, and corrections of markers."""
