"""A room with two to sixteen cameras around it: from the balls of all images to points, over all cameras at once."""
