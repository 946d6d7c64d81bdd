"""Mission files: `.waypoints` and `.plan`, read and written."""
