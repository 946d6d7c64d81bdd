"""The files that a plan writes: KML, GeoJSON, the profile, the summary, and the directory that holds them."""
