# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Any tree of YAML is a configuration or one short error; any tracks come back from CSV."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

pytest.importorskip('hypothesis')

from hypothesis import given, settings
from hypothesis import strategies as st
from rigid_gns_core import Scene
from rigid_gns_core.data.csv_tracks import read_csv_tracks
from rigid_gns_core.data.recipe import DataRecipe
from rigid_gns_core.errors import shown, UserError
from rigid_gns_core.files.config import from_mapping
from rigid_gns_core.files.strict_json import parse_json
from rigid_gns_core.scenes.start import StartRecipe

every_time = settings(derandomize=True, deadline=None, max_examples=150)
SCALARS = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8), st.dates()
)
NUMBERS = st.one_of(st.floats(), st.integers(-(2**70), 2**70))
TREES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4)
    ),
    max_leaves=12,
)
TIMES = st.integers(-(10**9), 10**9).map(lambda count: count / 1000)
KEYS = [*Scene.__dataclass_fields__, 'box', *Scene().to_mapping()['surfaces'][0]]
SCENES = st.dictionaries(st.sampled_from(KEYS) | st.text(max_size=5), TREES | NUMBERS, max_size=4)


def error_of(call: Callable[[], object]) -> str:
    """Text of the UserError that a call ends with; empty: it does not."""
    try:
        call()
    except UserError as error:
        return str(error) or 'an error without a text' * 1000
    return ''


@every_time
@given(SCENES | TREES)
def test_any_tree_is_a_scene_or_an_error(tree) -> None:
    said = error_of(lambda: Scene.from_mapping(tree))
    assert len(said) < 3000
    if not said:
        scene = Scene.from_mapping(tree)
        assert Scene.from_mapping(scene.to_mapping()) == scene


@every_time
@given(st.sampled_from([DataRecipe, StartRecipe]), st.data())
def test_any_tree_is_a_recipe_or_an_error(kind: type, data: st.DataObject) -> None:
    keys = st.sampled_from(list(kind.__dataclass_fields__))
    tree = data.draw(st.dictionaries(keys, TREES | NUMBERS, max_size=3))
    assert len(error_of(lambda: from_mapping(kind, tree))) < 3000


@every_time
@given(TREES | st.integers(10**4000, 10**5000))
def test_any_value_is_shown_in_a_line(value) -> None:
    assert 0 < len(shown(value)) <= 500


@every_time
@given(st.binary() | st.text())
def test_any_text_is_json_or_an_error(text: bytes | str) -> None:
    said = error_of(lambda: parse_json(text))
    assert not said or said.startswith('not valid JSON: ')


@settings(every_time, max_examples=40)
@given(
    st.lists(TIMES, min_size=1, max_size=6, unique=True),
    st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3),
)
def test_tracks_come_back_from_csv(times: list[float], place: list[float]) -> None:
    rows = [
        f'a,0,{time!r},{",".join(repr(value + k) for value in place)}'
        for k, time in enumerate(sorted(times))
    ]
    with TemporaryDirectory() as folder:
        path = Path(folder) / 'tracks.csv'
        path.write_text('\n'.join(['track,sphere,time,x,y,z', *rows]))
        (found,) = read_csv_tracks(path)
    expected = np.array(place) + np.arange(len(times))[:, None]
    assert np.array_equal(found.track.positions[:, 0], expected)
    assert found.track.begin == min(times)


def test_times_that_a_float64_cannot_tell_apart_are_named(tmp_path: Path) -> None:
    path = tmp_path / 'tracks.csv'
    path.write_text('track,sphere,time,x,y,z\na,0,-1,0,0,0\na,0,0,0,0,0\na,0,1e-20,0,0,0\n')
    with pytest.raises(UserError, match=r'tracks.csv line 4: track a, sphere 0: a second row'):
        read_csv_tracks(path)
