"""Worlds, bad links and other things that tests share."""
