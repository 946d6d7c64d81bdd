"""Simulated vehicles: how real autopilots handle and fly a mission, without an aircraft.

====================  ========================================================================================
`rehearsal`           upload to loopback vehicles, fly, judge
`outcome`             the result of a rehearsal, counted over its runs
`vehicle`             the simulated vehicle: its protocol, what it stores and sends, the server in front of it
`flight`              the simulated flight: a stored mission as a track, flown in simulated time
`sitl`                the rehearsal with real autopilots that fly by themselves
====================  ========================================================================================

The protocol part is written from the autopilots' sources and intentionally shares no code with
`gcsplan.mavlink.protocol.transfer` and `gcsplan.mavlink.mission.autopilots`; the flight part shares none with
`gcsplan.fleet`. So if two of them disagree, one of them is wrong about the aircraft.
"""
