"""The five papers' experiments run again."""
