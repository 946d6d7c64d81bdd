"""Loopback vehicles: what real autopilots do to a mission, without an aircraft.

====================  ========================================================================================
`…_storage`           what ArduPilot and PX4 keep of an item they are sent, and what they refuse
`…_protocol`          how each speaks the mission protocol: tables of transitions, no socket, no clock
`board`               what both share: the lists that survive a reboot, ACK codes, phases
`misbehaviour`        what can go wrong on purpose, drawn from a seed
`vehicle`             one vehicle: all of these behind one system id
`telemetry`           heartbeats, position, `parameters` and the answers to commands
`hub`                 one or many vehicles and their listeners: bytes in, bytes out
`server`              `sockets` and the clock: a hub behind one URL
====================  ========================================================================================

Written from the autopilots' sources and on purpose without a line shared with `gcsplan.mavlink.transfer` and
`gcsplan.mavlink.autopilots`: where the two disagree, one of them is wrong about the aircraft.
"""
