"""Convex pieces of free plane below a cap, and the exact shortest way over them (Polyanya)."""
