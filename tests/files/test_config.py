# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""YAML to frozen dataclasses: what is unknown is refused by name."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pytest
from rigid_gns_core import ContactLaw, Scene
from rigid_gns_core.errors import UserError
from rigid_gns_core.files.config import (
    config_folder,
    ConfigError,
    find_config,
    from_mapping,
    load_yaml,
    parse_yaml,
    to_mapping,
)


@dataclass(frozen=True)
class Inner:
    rate: float = 1.0


@dataclass(frozen=True)
class Outer:
    steps: int
    kind: Literal['a', 'b'] = 'a'
    sizes: tuple[int, ...] = ()
    range: tuple[float, float] = (0.0, 1.0)
    inner: Inner = Inner()
    folder: str | None = None
    on: bool = False

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise UserError(f'steps is {self.steps}, expected at least 1')


def test_roundtrip() -> None:
    mapping = {
        'steps': 3,
        'kind': 'b',
        'sizes': [1, 2],
        'range': [0, 2.5],
        'inner': {'rate': 4},
        'folder': 'x',
        'on': True,
    }
    config = from_mapping(Outer, mapping)
    assert config == Outer(3, 'b', (1, 2), (0.0, 2.5), Inner(4.0), 'x', True)
    assert isinstance(config.inner.rate, float)
    assert from_mapping(Outer, to_mapping(config)) == config
    assert from_mapping(Outer, {'steps': 1, 'inner': {'rate': 'inf'}}).inner.rate == float('inf')


@pytest.mark.parametrize(
    ('mapping', 'message'),
    [
        ({'steps': 1, 'stpes': 2}, r"Outer: unknown key 'stpes', allowed: steps, kind"),
        ({'steps': 1, 'inner': {'hz': 2}}, r"Outer\.inner: unknown key 'hz', allowed: rate"),
        ({}, r"missing key 'steps'"),
        ({'steps': 1.5}, r'Outer\.steps is 1\.5, expected int'),
        ({'steps': True}, r'Outer\.steps is True, expected int'),
        ({'steps': 0}, r'Outer: steps is 0, expected at least 1'),
        ({'steps': 1, 'kind': 'c'}, r"Outer\.kind is 'c', allowed: a, b"),
        ({'steps': 1, 'sizes': [1, 'x']}, r"Outer\.sizes\[1\] is 'x', expected int"),
        ({'steps': 1, 'sizes': 'abc'}, r"Outer\.sizes is 'abc', expected a list"),
        ({'steps': 1, 'range': [1]}, r'Outer\.range has 1 values, expected 2'),
        (
            {'steps': 1, 'inner': {'rate': 'fast'}},
            r"Outer\.inner\.rate is 'fast', expected a number",
        ),
        ({'steps': 1, 'inner': 3}, r'Outer\.inner is 3, expected a mapping'),
        ({'steps': 1, 'folder': 3}, r'Outer\.folder is 3, expected str'),
    ],
)
def test_bad_values_are_named(mapping: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        from_mapping(Outer, mapping)


@pytest.mark.parametrize(
    ('content', 'message'),
    [
        ('a: [1', r'not valid YAML: while parsing a flow sequence, expected .* line 1, column 6$'),
        ('a: 1\n\tb: 2', r'not valid YAML: .*cannot start any token, line 2, column 1$'),
        ('a: 1\n---\nb: 2', 'expected a single document.* line 2, column 1$'),
        ('a: {b: 1, c: 2, b: 3}', "key 'b' is given twice, line 1, column 17; remove one"),
        ('a: 1\n"a": 2', "key 'a' is given twice, line 2, column 1"),
        ('a: 010', '010 is read as 8, line 1, column 4; write it without'),
        ('a: [-1:30]', '-1:30 is read as -90, line 1'),
        ('a: 1:30.5', '1:30.5 is read as 90.5, line 1'),
        ('- 1', 'holds list, expected a mapping'),
        ('', 'holds NoneType'),
    ],
)
def test_bad_files_are_named(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / 'bad.yaml'
    path.write_text(content, encoding='utf-8')
    with pytest.raises(ConfigError, match=message) as caught:
        load_yaml(path)
    assert str(path) in str(caught.value)


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r'none\.yaml: no such file'):
        load_yaml(tmp_path / 'none.yaml')


def test_shipped_configuration_is_found_by_name(tmp_path: Path) -> None:
    assert find_config('scenes', 'box_154') == config_folder() / 'scenes' / 'box_154.yaml'
    own = tmp_path / 'own.yaml'
    own.write_text('a: 1\n', encoding='utf-8')
    assert find_config('scenes', own) == own
    with pytest.raises(ConfigError, match=r"'no_such'; shipped: .*box_154"):
        find_config('scenes', 'no_such')
    with pytest.raises(ConfigError, match='no such file'):
        find_config('scenes', tmp_path / 'none.yaml')


def test_every_shipped_yaml_is_a_mapping() -> None:
    files = sorted(config_folder().rglob('*.yaml'))
    assert files
    for path in files:
        assert load_yaml(path)


def test_a_mapping_in_place_of_a_number_is_told_by_what_it_stands_for() -> None:
    for given, message in (
        ({'slow': 1.5, 'fast': 0.9, 'speed': 1.0}, r'^where.restitution: slow of .* is 1.5, ex'),
        ({'slow': 0.5}, "^where.restitution: missing key 'fast'$"),
        ('high', "^where.restitution is 'high', expected a number"),
    ):
        with pytest.raises(ConfigError, match=message):
            from_mapping(ContactLaw, {'restitution': given}, 'where')


def test_what_yaml_reads_as_written_is_read() -> None:
    text = 'a: &a {x: 0, y: 0.5, z: -0.0}\nb: {<<: *a, x: 0x10}\nc: [0, 10, 1_000]\nd: "010"'
    assert parse_yaml(text) == {
        'a': {'x': 0, 'y': 0.5, 'z': 0.0},
        'b': {'x': 16, 'y': 0.5, 'z': 0.0},
        'c': [0, 10, 1000],
        'd': '010',
    }
    assert parse_yaml('{a: 010, a: 1:30}', strict=False) == {'a': 90}


def test_several_types_are_one_line() -> None:
    with pytest.raises(ConfigError, match=r'^where.mass is True, expected a number or a list$'):
        from_mapping(Scene, {'mass': True}, 'where')
