"""Tests of missions and what autopilots keep of them."""
