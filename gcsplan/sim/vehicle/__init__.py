"""The simulated vehicle, from what it stores up to the server in front of it.

====================  ========================================================================================
`ardupilot`, `px4`    each autopilot's side of the mission protocol: tables of transitions, no socket, no clock; which
                      parts of an item it stores, and which items it refuses
`stored_lists`        what both share: the lists that survive a reboot, phases, how a param reads back
`firmware`            the versions, and what differs between them
`misbehaviour`        intentional faults, drawn from a seed
`loopback`            one vehicle: all of these behind one system id
`telemetry`           heartbeats, position, `parameters`, `terrain_memory` and the answers to commands
`hub`                 one or many vehicles and their listeners: bytes in, bytes out
`server`              sockets and the clock: a hub behind one URL
====================  ========================================================================================
"""
