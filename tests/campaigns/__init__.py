"""Randomised attacks that run for a chosen time: python -m tests.campaigns.NAME --seconds N."""
