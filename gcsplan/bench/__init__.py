"""Every benchmark lives here; each prints what it measured and a ratio, since machines are noisy."""
