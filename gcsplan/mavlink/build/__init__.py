"""Builders: from a path to mission items, and from zones to a fence."""
