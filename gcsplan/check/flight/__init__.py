"""A mission followed item by item: its route, corners, arcs and times."""
