"""Why there is no path, and what would help."""
