"""Tests of the mission protocol without sockets or clock."""
