"""Examples are drawn the same way in every run, so that what fails once fails again; each may take its time."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")
