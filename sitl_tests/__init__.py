"""gcsplan against peers that others wrote, over loopback: MAVSDK, pymavlink, SITL; and a lossy relay.

pymavlink decides between MAVLink 1 and 2 when it is imported: here it is always 2."""

import os

os.environ["MAVLINK20"] = "1"
