"""The only reader of the user's request: a mission file becomes vehicles, zones and a surface in metres.

`load` says in which order things are asked; `schema` holds the keys, `vehicles` and `stops` what the aircraft shall do,
`world` points, terrain and zones; `zone_geojson` and `zone_kml` read zones from files of others.
"""

from gcsplan.mission_file.load import load_mission
from gcsplan.mission_file.request import ArrivalRequest, MissionFile, PlannerRequest, VehicleRequest

__all__ = ["ArrivalRequest", "MissionFile", "PlannerRequest", "VehicleRequest", "load_mission"]
