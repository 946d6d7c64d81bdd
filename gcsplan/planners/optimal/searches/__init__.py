"""Sources of paths: searches other than that for the shortest track below a cap."""
