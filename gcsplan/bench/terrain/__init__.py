"""The benchmark of planners over real terrain."""
