"""The free plane below an altitude cap, cut into convex pieces, and exact shortest tracks over them (Polyanya)."""
