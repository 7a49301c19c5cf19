"""File formats: one module each; `registry` knows all of them."""
