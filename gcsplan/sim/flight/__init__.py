"""The simulated flight of a stored mission.

====================  ========================================================================================
`kinematics`          how a vehicle moves: accelerations, rates, corners
`scurves`             legs between two standstills as ArduPilot's copter flies them
`track`               a stored mission as a line in space, with the speed limits of each piece
`mission_flight`      flies tracks in simulated time, all vehicles of all runs at once
`wind`                wind, gusts and position error, from a seed
`trace`               what was flown, checked against limits and for separation
====================  ========================================================================================
"""
