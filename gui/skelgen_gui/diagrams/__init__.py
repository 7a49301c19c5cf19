"""The graph of joint costs with the tree, and the matrix of distance deviations."""
