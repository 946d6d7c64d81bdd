"""What a plan leaves on the disk: KML, GeoJSON, the profile, the summary, and the directory that holds them."""
