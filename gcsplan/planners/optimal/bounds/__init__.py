"""Sources of bounds: what no path can be shorter or cheaper than."""
