"""Attacks that run as long as one likes: python -m tests.campaigns.NAME --seconds N."""
