"""Which of the published formats a file has: OpenAir by its name, the others by members that no other format has."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gcsplan.mission_file.published.ed269 import is_ed269, read_ed269
from gcsplan.mission_file.published.ed318 import is_ed318, read_ed318
from gcsplan.mission_file.published.openaip import is_openaip, read_openaip
from gcsplan.mission_file.published.openair import OPENAIR_SUFFIXES, read_openair
from gcsplan.mission_file.published.policy import Policy
from gcsplan.mission_file.zones.file import ZoneFile


def read_published(path: Path, data: bytes, whole: Any, policy: Policy) -> ZoneFile | None:
    """The zones of a published file; None if it has none of these formats. ``whole`` is what its JSON holds."""
    if path.suffix.lower() in OPENAIR_SUFFIXES:
        return read_openair(path, data, policy)
    for is_format, read in ((is_ed269, read_ed269), (is_ed318, read_ed318), (is_openaip, read_openaip)):
        if is_format(whole):
            return read(path, whole, policy)
    return None
