"""Tracklets merged into markers: by the likelihood of their distances, over short gaps, and across pauses."""
