"""The report for a person to read before the flight."""
