# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which terms are taken out again."""

from __future__ import annotations

from dataclasses import replace

from launched_balls import GIVEN
import numpy as np
import pytest
from rigid_gns_core.identification import ladder
from rigid_gns_core.identification.ladder import Ladder, Rung, Setup
from rigid_gns_core.identification.parameters import Laws
from rigid_gns_core.identification.terms import core_terms, Met


@pytest.mark.parametrize(
    ('name', 'change', 'deviation', 'taken_out'),
    [
        ('without drag by spin', -0.005, 0.1, True),
        ('without drag by spin', 0.005, 0.1, False),
        # what other tracks tell of a spin stays where it is a draw
        ('without spins of other tracks', -0.005, 0.1, False),
        ('without spins of other tracks', -0.2, 0.1, True),
    ],
)
def test_a_term_is_taken_out_where_tracks_are_predicted_as_well(
    monkeypatch: pytest.MonkeyPatch, name: str, change: float, deviation: float, taken_out: bool
) -> None:
    laws = Laws(GIVEN)
    given = Setup(('air.drag_slope',), 'learned', np.inf, (1e-3, 1e-4, 1e-3))
    met = Met(10, (10,), (0,), (0,), 0.01)
    (removal,) = (rung for _, rung in core_terms(laws, met) if rung and rung.name == name)
    monkeypatch.setattr(ladder, 'paired', lambda *_: (change, deviation))
    monkeypatch.setattr(Ladder, '_predict', lambda *_: [])
    search = Ladder(laws, [], given)
    assert search.drop(removal) is taken_out
    assert (search.setup == given) is not taken_out
    assert search.drop(Rung('nothing', lambda setup: replace(setup))) is None
