"""Tests of rehearsals in SITL."""
