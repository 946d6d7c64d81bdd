"""The plan of one vehicle: its problem, the attempts at it, and what it becomes."""
