"""The process of a command: how it ends, what it hears, what it takes."""
