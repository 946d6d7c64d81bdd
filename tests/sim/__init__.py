"""Tests of simulated vehicles and rehearsals."""
