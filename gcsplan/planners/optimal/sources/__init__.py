"""Sources of paths: searches beside the shortest track below a cap."""
