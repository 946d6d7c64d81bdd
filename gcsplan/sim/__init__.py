"""Simulated vehicles: what real autopilots do to a mission, without an aircraft.

====================  ========================================================================================
`…_storage`           what ArduPilot and PX4 keep of an item they are sent, and what they refuse
`…_protocol`          how each speaks the mission protocol: tables of transitions, no socket, no clock
`board`               what both share: the lists that survive a reboot, ACK codes, phases
`misbehaviour`        what can go wrong on purpose, drawn from a seed
`vehicle`             one vehicle: all of these behind one system id
`telemetry`           heartbeats, position, `parameters` and the answers to commands
`hub`                 one or many vehicles and their listeners: bytes in, bytes out
`server`              `sockets` and the clock: a hub behind one URL
`kinematics`          how a vehicle moves: accelerations, rates, corners
`track`               a stored mission as a line in space, with what limits the speed on each piece
`mission_flight`      flies tracks in simulated time, all vehicles of all runs at once
`wind`                wind, gusts and position error, from a seed
`trace`               what was flown, held against limits and against each other
`outcome`             how a rehearsal ended, counted over its runs
`rehearsal`           upload to loopback vehicles, fly, judge
`sitl`                the same with real autopilots that fly by themselves; `sitl_instances` starts them
====================  ========================================================================================

The protocol's half is written from the autopilots' sources and on purpose without a line shared with
`gcsplan.mavlink.protocol.transfer` and `gcsplan.mavlink.mission.autopilots`, the flight's half without one shared with
`gcsplan.fleet`: where two disagree, one of them is wrong about the aircraft.
"""
