"""Tables, lines and progress for people."""
