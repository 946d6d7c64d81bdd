"""The rehearsal with real autopilots: ArduPilot in SITL."""
