"""Winds that a mission declares, and what an aircraft can do in them."""
