"""Keys and values of a mission file: YAML, units, places, the schema, and mistakes."""
