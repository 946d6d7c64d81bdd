#!/usr/bin/env python3
"""Plan a fleet, rehearse it, upload it to all vehicles at once, and print when to start each of them.

    python missions/upload_fleet.py missions/fleet-4.yaml sim

The second argument is that of `gcsplan plan --upload`: a URL for all vehicles, `link` (the links of the mission file),
`sim`, or NAME=URL. Nothing is sent unless the rehearsal succeeds; if one vehicle refuses its mission, none keeps one.
"""

from __future__ import annotations

import sys

from gcsplan import load_mission, plan, rehearse, upload
from gcsplan.errors import GcsplanError


def main(mission_file: str, where: str) -> int:
    """Plan, rehearse, upload; return the exit code, 0 if every mission is on board and verified."""
    try:
        planned = plan(load_mission(mission_file))
        rehearsed = rehearse(planned)
        if (error := rehearsed.error()) is not None:
            raise error
        results = upload(planned, to=where, atomic=True)
    except GcsplanError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    for result in results:
        said = "verified" if result.verified else f"{result.outcome}: {result.message}"
        print(f"{result.vehicle}: {result.items} items, {said}")
    if not all(result.verified for result in results):
        return max(result.code for result in results)
    assert planned.fleet is not None
    for slot in planned.fleet.slots:
        print(f"{slot.name}: start at T+{slot.depart_s:.1f} s, at its goal at T+{slot.arrive_s:.1f} s")
    return 0


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
