# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Planes of interest, as text."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_gns_core import Plane, UserError
from rigid_gns_core.forecasts.crossing_planes import planes_of


def test_planes_are_read_by_name() -> None:
    text = """
        racket: {point: [0.5, 0, 0.3], normal: [-1, 0, 0]}
        bin: {point: [1, 2, 0.1], normal: [0, 0, 1], direction: [1, 0, 0], length_x: 0.3,
              length_y: 0.2}
    """
    assert planes_of(text) == {
        'racket': Plane((0.5, 0.0, 0.3), (-1.0, 0.0, 0.0)),
        'bin': Plane((1.0, 2.0, 0.1), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), 0.3, 0.2),
    }
    assert planes_of('racket: {point: [0, 0, 1], normal: [0, 0, 1]}')['racket'].length_x == np.inf
    assert planes_of('') == planes_of('  ') == {}


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('{', 'crossing_planes: not valid YAML: .*, line 1, column 2; expected {racket'),
        ('a: 2020-99-01', 'crossing_planes: not valid YAML: month'),
        ('[' * 5000, 'crossing_planes: not valid YAML: it is nested too deeply'),
        ('a: {normal: [0, 0, 1]}\na: 3', "key 'a' is given twice, line 2, column 1"),
        ('[1, 2]', 'expected names and planes'),
        ('racket: 3', r'crossing_planes\.racket is 3, expected \{racket: \{point'),
        ('racket: {point: [0, 0, 1]}', 'normal'),
        ('racket: {point: [0, 0, 1], normal: [0, 0, 1], size: 2}', "unknown key 'size'"),
        ('racket: {point: [0, 0], normal: [0, 0, 1]}', 'racket'),
        ('racket: {point: [0, 0, 1], normal: [0, 0, 0]}', 'a vector that is not zero'),
        ('racket: {point: [0, 0, 1], normal: [0, 0, 1], length_x: -1}', 'length_x'),
    ],
)
def test_what_is_no_plane_is_named(text: str, message: str) -> None:
    with pytest.raises(UserError, match=message):
        planes_of(text)
