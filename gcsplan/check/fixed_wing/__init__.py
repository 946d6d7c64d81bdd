"""What a fixed wing flies otherwise: climb-out, arcs, early turns and the glide to land."""
