"""The only reader of the user's request: a mission file becomes vehicles, zones and a surface in metres.

`load` reads the parts in their order; `schema` holds the keys, `vehicles` the aircraft, `terminals` where each starts,
passes and arrives, `world` points, terrain and zones; `zone_geojson` and `zone_kml` read zones from files of others.
"""

from gcsplan.mission_file.load import load_mission
from gcsplan.mission_file.request import ArrivalRequest, MissionFile, PlannerRequest, VehicleRequest

__all__ = ["ArrivalRequest", "MissionFile", "PlannerRequest", "VehicleRequest", "load_mission"]
