"""The only reader of the user's request: it turns a mission file into vehicles, zones and a surface in metres.

`load_mission` reads the parts in order. `values` holds the keys and how values are written, `vehicles` the aircraft,
`terminals` the start, via points and goal of each, `scene` points, terrain and zones. `zones` has the readers of zone
files of other programs, `published` those of authorities; `read_zones` chooses the reader of a file.
"""

from gcsplan.mission_file.load import load_mission
from gcsplan.mission_file.request import ArrivalRequest, MissionFile, PlannerRequest, VehicleRequest

__all__ = ["ArrivalRequest", "MissionFile", "PlannerRequest", "VehicleRequest", "load_mission"]
