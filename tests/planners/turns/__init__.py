"""Tests of fixed wings."""
