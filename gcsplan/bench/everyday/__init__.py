"""The benchmark of everyday missions."""
