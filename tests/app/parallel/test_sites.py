"""The terrain and zones of a mission in another process: read once, and never other ones than the sender's."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.app.parallel.sites import site_of, widened, world_of
from gcsplan.errors import InputError
from gcsplan.mission_file import load_mission
from tests.support.batches import mission

DISC = {"name": "disc", "center": [47.0, 8.01], "radius_m": 50}


def test_a_site_is_read_once_and_is_the_senders_world() -> None:
    source = load_mission(text=mission(no_fly=[DISC]))
    site = pickle.loads(pickle.dumps(site_of(source)))
    read, world = site.read()
    assert np.allclose(world.frame.to_degrees(100.0, 200.0), source.frame.to_degrees(100.0, 200.0), atol=0.0)
    assert [zone.name for zone in world.airspace.zones] == ["disc"]
    assert read.inputs == source.inputs
    again, same = site.read()
    assert again is read
    assert same is world


def test_missions_that_differ_have_other_keys() -> None:
    first, second = (site_of(load_mission(text=mission(**more))) for more in ({}, {"no_fly": [DISC]}))
    assert first.key != second.key
    assert first.key == site_of(load_mission(text=mission())).key


def test_other_terrain_than_the_senders_is_refused() -> None:
    site = site_of(load_mission(text=mission()))
    with pytest.raises(InputError):
        replace(site, key="another", inputs={**site.inputs, "terrain_sha256": "0" * 64, "zones_sha256": "0"}).read()


def test_terrain_of_a_level_that_cannot_be_read_is_refused() -> None:
    source = replace(load_mission(text=mission()), at_level=None)
    assert widened(source, source.level) is source
    with pytest.raises(InputError, match="cannot be read here"):
        widened(source, source.level + 1)


def test_the_world_has_the_missions_zones_and_scale() -> None:
    source = load_mission(text=mission(no_fly=[DISC]))
    world = world_of(source)
    assert world.airspace.zones == tuple(source.zones)
    assert world.airspace.surface is source.surface
