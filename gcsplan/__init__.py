"""gcsplan."""
