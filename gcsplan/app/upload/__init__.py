"""From a plan or files to vehicles: orders, fences, terrain, reading back."""
