"""Kernels run both ways: as machine code, and as the plain functions that they were made from."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
import pytest

from gcsplan.native.signature import Held


def run_both_ways(monkeypatch: pytest.MonkeyPatch, module: ModuleType, name: str) -> list[int]:
    """From now on ``module.name`` runs its plain function, too, on copies of its arguments, and compares all arrays and
    the result. The list that is returned grows by the result of each call."""
    kernel = getattr(module, name)
    results: list[int] = []

    def both(*arguments: Any) -> int:
        flat = [x for a in arguments for x in (a.arguments if isinstance(a, Held) else (a,))]
        copies = [a.copy() if isinstance(a, np.ndarray) else a for a in flat]
        expected = kernel.__wrapped__(*copies)
        found: int = kernel(*arguments)
        assert found == int(expected or 0)
        for here, there in zip(flat, copies, strict=True):
            if isinstance(here, np.ndarray):
                np.testing.assert_allclose(here, there, rtol=1e-9, atol=1e-9, equal_nan=True)
        results.append(found)
        return found

    monkeypatch.setattr(module, name, both)
    return results
