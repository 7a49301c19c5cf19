"""The pane in which markers get names: what needs work, what a marker is called, and what the take leaves open."""
