"""Tests of altitudes over a fixed track."""
