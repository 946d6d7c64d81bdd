"""Zones in files: a reader for each format, and the drafts that they make."""
