"""Independent second implementations that the package's results are compared with."""
