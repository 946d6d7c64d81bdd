"""The benchmark of swarms over real terrain."""
