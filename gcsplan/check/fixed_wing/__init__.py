"""The flight of a fixed wing, where it differs: climb-out, arcs, early turns and the glide to land."""
