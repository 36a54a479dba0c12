# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a scene keeps of a tracker."""

from __future__ import annotations

import copy
from dataclasses import replace
import json
from pathlib import Path

import pytest
from rigid_gns_core import load_scene, Scene
from rigid_gns_core.scenes.correction import Correction
from rigid_gns_core.scenes.regions import Regions
from rigid_gns_core.scenes.tracker import Spins, Tracker
import yaml

ROW = (0.1, 0.2, 1.0, 4.0, 0.1 + 0.2, 1.0, 1 / 3, 50.0, 0.0, 9.0, 0.0, 0.0, 9.0, 0.0, 9.0)


@pytest.mark.parametrize('spins', [None, Spins((ROW, ROW)), Spins((ROW,), 0.2, 0.3, 5.0)])
def test_a_scene_written_and_read_back_is_the_same(tmp_path: Path, spins: Spins | None) -> None:
    scene = Scene(tracker=Tracker(noise=0.7e-3, drift=1 / 3e3, spins=spins))
    mapping = scene.to_mapping()
    assert Scene.from_mapping(json.loads(json.dumps(mapping))) == scene
    path = tmp_path / 'lab.yaml'
    path.write_text(yaml.safe_dump({'scene': mapping, 'card': {'notes': ['of no part']}}))
    assert load_scene(path) == scene
    assert 'tracker' not in Scene().to_mapping()


def test_a_correction_written_and_read_back_is_the_same() -> None:
    correction = Correction(((0.1 + 0.2,) * 16, (1 / 3,) * 16), (0.1,) * 10, 0.5, 0.05)
    scene = Scene(tracker=Tracker(noise=1e-3, correction=correction))
    text = yaml.safe_dump(scene.to_mapping())
    assert Scene.from_mapping(yaml.safe_load(text)) == scene


def test_equal_scenes_are_one_key_and_others_are_not() -> None:
    """Hashes are kept, also by copies, and must be those of the values."""
    own = Correction(((0.1,) * 16, (1 / 3,) * 16), (0.1,) * 10, 0.5, 0.05)
    tracker = Tracker(noise=1e-3, correction=own, spins=Spins((ROW, ROW)))
    scene = Scene(tracker=tracker)
    hash(scene)
    again = Scene.from_mapping(json.loads(json.dumps(scene.to_mapping())))
    assert len({scene, again, copy.deepcopy(scene)}) == 1
    for other in (replace(own, bandwidth=0.6), replace(own, scales=(0.2,) * 10)):
        assert hash(other) != hash(own)
    spins = (Spins((ROW, ROW)), Spins((ROW,)), Spins((ROW,), 0.2), Spins((ROW,), floor=1.0))
    assert len({hash(one) for one in spins}) == len(spins)


def test_regions_written_and_read_back_are_the_same() -> None:
    regions = Regions(((0.2, 1 / 3, 0.1 + 0.2), (1.0, 0.9, 2.1)))
    scene = Scene(tracker=Tracker(noise=1e-3, regions=regions))
    text = yaml.safe_dump(scene.to_mapping())
    assert Scene.from_mapping(yaml.safe_load(text)) == scene


@pytest.mark.parametrize(
    ('make', 'message'),
    [
        (lambda: Tracker(noise=0.0), 'noise of a tracker is 0, expected greater than 0'),
        (lambda: Tracker(noise=1e-3, drift=-1.0), 'drift of a tracker is -1, expected at least 0'),
        (lambda: Spins((ROW[:-1],)), r'rows of \[14\] numbers, expected rows of 15'),
        (lambda: Spins(()), r'rows of \[\] numbers'),
        (lambda: Spins((ROW,), bandwidth=0.0), 'bandwidth of spins is 0, expected more than 0'),
        (lambda: Correction(((0.1,) * 15,), (0.1,) * 10, 0.5, 0.05), r'rows of \[15\] numbers'),
        (lambda: Correction(((0.1,) * 16,), (0.1,) * 9, 0.5, 0.05), '9 scales, expected rows'),
        (lambda: Correction(((0.1,) * 16,), (0.0,) * 10, 0.5, 0.05), 'a scale .* is 0, expected'),
        (lambda: Correction(((0.1,) * 16,), (0.1,) * 10, 0.0, 0.05), 'bandwidth of a correction'),
        (lambda: Correction(((float('nan'),) * 16,), (1.0,) * 10, 0.5, 0.05), 'not finite'),
        (lambda: Scene(tracker=1e-3), r'tracker is 0.001, expected Tracker\(...\), or None'),
    ],
)
def test_values_are_checked(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]
