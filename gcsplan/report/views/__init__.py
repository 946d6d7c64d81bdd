"""The views of a page: map, profiles, fleet, way home, rehearsal, tables."""
