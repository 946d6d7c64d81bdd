"""Tests of from a request to what is done."""
