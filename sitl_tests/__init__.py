"""gcsplan against peers that others wrote, over loopback: MAVSDK, pymavlink, ArduPilot's SITL; and a lossy relay."""
