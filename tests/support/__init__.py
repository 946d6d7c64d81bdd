"""Worlds, bad links and other helpers that tests share."""
