"""Simulated vehicles: how real autopilots handle and fly a mission, without an aircraft.

====================  ========================================================================================
`…_storage`           which parts of an item ArduPilot and PX4 store, and which items they refuse
`…_protocol`          each autopilot's side of the mission protocol: tables of transitions, no socket, no clock
`board`               what both share: the lists that survive a reboot, ACK codes, phases
`misbehaviour`        intentional faults, drawn from a seed
`vehicle`             one vehicle: all of these behind one system id
`telemetry`           heartbeats, position, `parameters` and the answers to commands
`hub`                 one or many vehicles and their listeners: bytes in, bytes out
`server`              `sockets` and the clock: a hub behind one URL
`kinematics`          how a vehicle moves: accelerations, rates, corners
`track`               a stored mission as a line in space, with the speed limits of each piece
`mission_flight`      flies tracks in simulated time, all vehicles of all runs at once
`wind`                wind, gusts and position error, from a seed
`trace`               what was flown, checked against limits and for separation
`outcome`             the result of a rehearsal, counted over its runs
`rehearsal`           upload to loopback vehicles, fly, judge
`sitl`                the same with real autopilots that fly by themselves; `sitl_instances` starts them
====================  ========================================================================================

The protocol part is written from the autopilots' sources and intentionally shares no code with
`gcsplan.mavlink.protocol.transfer` and `gcsplan.mavlink.mission.autopilots`; the flight part shares none with
`gcsplan.fleet`. So if two of them disagree, one of them is wrong about the aircraft.
"""
