"""What all rooms of the window build with: theme, preferences, forms, dialogs, commands, helpers that paint."""
