"""From pixels to points in space and back: lens, epipolar geometry, optimal triangulation with its covariance."""
