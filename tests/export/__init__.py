"""Tests of outputs and their directory."""
