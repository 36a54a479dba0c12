# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A damaged text on ~/scene: what can be read without it is, else an error names it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType
import pytest
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.bags.topics import find_topics
from rigid_gns_core.errors import UserError
from rigid_gns_core.forecasts.node_parameters import SIMULATOR, with_defaults
from rigid_gns_core.messages.poses import decode_string, encode_float64, encode_string
from rigid_gns_core.recordings.scoring.evaluate import score_bag
from rigid_gns_core.recordings.scoring.reproduce import reproduce
from rigid_gns_core.studies.foreign_files.bags import small_bag, written

SCENE, STEP = '/simulator/scene', '/simulator/step_time'


def bag_with(path: Path, *, step: bytes | None = None, **said: Any) -> Path:
    """Write a bag in which ~/scene says other things, and one step time is another message."""
    whole = path.with_name('whole.mcap')
    whole.write_bytes(small_bag())
    messages = []
    for name, topic in read_bag(whole).topics.items():
        for k, (time, cdr) in enumerate(zip(topic.times.tolist(), topic.messages, strict=True)):
            changed = cdr
            if name == SCENE:
                changed = encode_string(json.dumps(json.loads(decode_string(cdr)) | said))
            elif name == STEP and step is not None and k == 3:
                changed = step
            messages.append((name, topic.type_name, time, changed))
    path.write_bytes(written(sorted(messages, key=lambda m: m[2]), CompressionType.NONE))
    return path


@pytest.mark.parametrize(
    'said', [{'dt': 'x'}, {'parameters': []}, {'model_card': 3}, {'topics': 'x'}, {'model': [1]}]
)
def test_what_is_not_needed_may_be_damaged(tmp_path: Path, said: dict[str, Any]) -> None:
    report = score_bag(read_bag(bag_with(tmp_path / 'bag.mcap', **said))).report
    assert report['frames']['compared'] == 34


def test_a_damaged_step_time_is_left_out(tmp_path: Path) -> None:
    path = bag_with(tmp_path / 'bag.mcap', step=encode_float64(1.0)[:7])
    assert score_bag(read_bag(path)).report['timing']['steps_timed'] == 33


def test_a_damaged_parameter_is_named(tmp_path: Path) -> None:
    path = bag_with(tmp_path / 'bag.mcap', parameters={'velocity_window': 'six'})
    bag = read_bag(path)
    with (
        pytest.raises(
            UserError, match=r"bag.mcap: parameter velocity_window is recorded as 'six'"
        ),
        bag.naming_damage(),
    ):
        reproduce(bag, find_topics(bag))


@pytest.mark.parametrize(
    ('value', 'said'),
    [
        ({'velocity_window': 6.0}, 'expected int'),
        ({'velocity_window': 0}, 'expected 1 to 100'),
        ({'rate': float('nan')}, 'expected 0 to 1000'),
        ({'match_spheres': 1}, 'expected bool'),
        ({'start': 'now'}, 'allowed: first, every, diverged'),
        ({'gravity_direction': [0.0]}, '3 finite numbers'),
    ],
)
def test_parameters_are_checked_as_the_node_checks_them(value: dict[str, Any], said: str) -> None:
    assert with_defaults({}) == {spec.name: spec.default for spec in SIMULATOR}
    assert with_defaults({'rate': 20, 'of_a_later_version': 1})['rate'] == 20.0
    with pytest.raises(UserError, match=said):
        with_defaults(value)
