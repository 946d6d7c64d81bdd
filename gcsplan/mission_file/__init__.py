"""The only reader of the user's request: it turns a mission file into vehicles, zones and a surface in metres.

`load` reads the parts in order. `values` holds the keys, `vehicles` the aircraft, `terminals` the start, via points and
goal of each, `scene` points, terrain and zones. `zones` reads zone files of other programs, `published` those of
authorities.
"""

from gcsplan.mission_file.load import load_mission
from gcsplan.mission_file.request import ArrivalRequest, MissionFile, PlannerRequest, VehicleRequest

__all__ = ["ArrivalRequest", "MissionFile", "PlannerRequest", "VehicleRequest", "load_mission"]
