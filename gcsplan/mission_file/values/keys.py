"""The base of every section of a mission file, and the kinds of number that sections share."""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

LARGEST_KEY_M = 1e6
"""Largest number of metres that a key takes, so that slips are found."""

FiniteMetres = Annotated[float, Field(ge=-LARGEST_KEY_M, le=LARGEST_KEY_M)]
Length = Annotated[float, Field(ge=0.0, le=LARGEST_KEY_M)]

_WITH_ERROR = re.compile(r"\s*(\d{1,9}(?:\.\d{1,9})?)\s*(?:±|\+/?-)\s*(\d{1,9}(?:\.\d{1,9})?)\s*", re.ASCII)


def with_error(value: Any) -> tuple[float, float] | None:
    """The number and its error of a text such as ``5 ± 2`` (or ``5 +- 2``); None for anything else."""
    found = _WITH_ERROR.fullmatch(value) if isinstance(value, str) else None
    return None if found is None else (float(found[1]), float(found[2]))


class Keys(BaseModel):
    """A section of the file. The string below a key is its description in the reference (docs/_build_reference.py)."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False, defer_build=True)

    @property
    def given(self) -> dict[str, Any]:
        """The keys that are in the file, with their values."""
        return {k: getattr(self, k) for k in self.model_fields_set}
