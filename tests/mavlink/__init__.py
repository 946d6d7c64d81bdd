"""Tests of MAVLink."""
