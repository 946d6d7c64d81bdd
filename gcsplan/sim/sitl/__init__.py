"""The rehearsal with real autopilots: ArduPilot in SITL.

====================  ========================================================================================
`flights`             upload, arm, start, observe and judge; why a vehicle does not arrive
`instances`           starts one SITL for each vehicle, with its airframe and parameters
`wind_parameters`     the wind in an SITL
====================  ========================================================================================
"""
