"""Tests. pymavlink decides between MAVLink 1 and 2 when it is imported: here it is always 2."""

import os

os.environ["MAVLINK20"] = "1"
