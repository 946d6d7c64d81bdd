"""Tests of gcsplan with programs of other projects over loopback: MAVSDK, pymavlink, MAVProxy, SITL; and a lossy relay.

pymavlink chooses between MAVLink 1 and 2 when it is imported; here it is always 2."""

import os

os.environ["MAVLINK20"] = "1"
