"""The benchmark of cost against size."""
