"""What a person looks at before the flight."""
