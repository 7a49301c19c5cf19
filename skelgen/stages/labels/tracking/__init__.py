"""Points followed from frame to frame into tracks, and the tracklets that the tracks give."""
