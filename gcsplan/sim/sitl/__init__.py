"""The rehearsal with real autopilots: ArduPilot in SITL.

====================  ========================================================================================
`flights`             upload, arm, start, observe and judge
`instances`           starts one SITL for each vehicle, with its airframe and parameters
`wind_parameters`     the wind in an SITL
`flight_watch`        why a vehicle does not arrive
====================  ========================================================================================
"""
