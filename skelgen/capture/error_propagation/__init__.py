"""From the noise of balls in the images to points, bodies and joint angles (Gaschler 2011, chapter 6.1)."""
