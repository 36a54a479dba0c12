# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A correction of starts is learned where the laws lack something, and only there."""

from __future__ import annotations

from launched_balls import GIVEN, launched, NOISE, true_scene
import numpy as np
import pytest
from rigid_gns_core.identification.correction_fit import CorrectionFit, kept, Missed
from rigid_gns_core.identification.ladder import Fold, Ladder, Setup
from rigid_gns_core.identification.learn import correction_of
from rigid_gns_core.identification.parameters import Laws
from rigid_gns_core.identification.stretches import pieces, stretches
from rigid_gns_core.tracking.start_correction import kernel


def starts(count: int, seed: int) -> list[Missed]:
    """Starts of three windows a track, near each other, and what forecasts from them missed."""
    rng = np.random.default_rng(seed)
    return [
        Missed(
            track=k // 3,
            features=rng.normal(0.0, 2e-3, 10),
            slopes=rng.normal(0.0, 0.02, (6, 6)),
            missed=rng.normal(0.0, 0.03, 6),
            leads=np.repeat([0.2, 0.4], 3),
        )
        for k in range(count)
    ]


def test_without_a_track_is_as_if_it_had_not_been_there() -> None:
    found = starts(18, 0)
    part = CorrectionFit(found, 1e-3).without(2)
    alone = CorrectionFit([one for one in found if one.track != 2], 1e-3).whole()
    inside = np.array([one.track != 2 for one in found])
    np.testing.assert_allclose(part.weights[inside], alone.weights, atol=1e-9)
    np.testing.assert_array_equal(part.weights[~inside], 0.0)


def test_what_all_starts_miss_alike_is_learned() -> None:
    """40 tracks that miss by half a deviation of the first part, but for noise of 1 mm."""
    rng = np.random.default_rng(1)
    found = []
    for one in starts(120, 1):
        missed = 0.5 * one.slopes[:, 0] + rng.normal(0.0, 1e-3, 6)
        found.append(Missed(one.track, one.features, one.slopes, missed, one.leads))
    fit = CorrectionFit(found, 1e-3).whole()
    alike = kernel(np.zeros((1, 10)), fit.features / fit.scales, fit.bandwidth)
    expected = [[0.5, 0.0, 0.0, 0.0, 0.0, 0.0]]
    # noise of 1 mm leaves 0.002 of a slope of 20 mm; a prior that starts differ, some more
    np.testing.assert_allclose(alike @ fit.weights, expected, atol=0.03)


def test_a_forecast_that_misses_by_far_counts_for_little() -> None:
    found = starts(60, 2)
    before = CorrectionFit(found, 1e-3).whole().weights.sum(axis=0)
    one = found[0]
    found[0] = Missed(one.track, one.features, one.slopes, 100.0 * one.missed, one.leads)
    after = CorrectionFit(found, 1e-3).whole().weights.sum(axis=0)
    # were it taken as the others are, it would move the sum by tens
    assert np.abs(after - before).max() < 1.0


def corrected(cross: float) -> Ladder:
    """Ladder of the true laws with a correction tried, on tracks with a hidden force across."""
    laws = Laws(true_scene())
    found = pieces(launched(24, 5, cross), GIVEN, ['0'], laws.models, NOISE)
    folds = []
    for k in range(2):
        inside = stretches([one for one in found if one.track % 2 != k], laws.models, NOISE)
        folds.append(Fold(inside, [one for one in found if one.track % 2 == k]))
    ladder = Ladder(laws, folds, Setup((), 'learned', np.inf, (NOISE, 1e-4, 1e-3)))
    ladder.begin()
    ladder.correct()
    return ladder


def test_a_hidden_force_is_corrected_on_left_out_tracks() -> None:
    """1 m/s^2 across for each 0.4 m/s that a shot is faster: of no law, but of the start.

    With four seeds the mean errors after 0.4 s are 0.71 to 0.77 of those before.
    """
    ladder = corrected(2.5)
    line = ladder.table[-1]
    assert line.name == 'correction of starts' and line.kept and ladder.correction is not None
    before, after = ladder.table[0].every['0.4'], line.every['0.4']
    assert after[1] < 0.8 * before[1]
    rows = kept(ladder.correction.whole())
    assert len(rows.windows) == len(ladder.correction.features) and rows.bandwidth == 0.5


def test_what_a_scene_keeps_is_learned_of_the_fits_given() -> None:
    """Of the folds' own fits it is what the ladder tried; of other laws it is another."""
    ladder = corrected(2.5)
    groups = [{one.track for one in fold.outside} for fold in ladder.folds]
    parts = [(fold.fitted.values, fold.prior) for fold in ladder.folds if fold.fitted]
    again = correction_of(ladder, ladder.laws, parts, groups).whole()
    assert ladder.correction is not None
    np.testing.assert_array_equal(again.weights, ladder.correction.whole().weights)
    lighter = [({'gravity.z': -9.0}, prior) for _, prior in parts]
    other = correction_of(ladder, ladder.laws, lighter, groups).whole()
    assert np.abs(other.weights - again.weights).max() > np.abs(again.weights).max()


def test_complete_laws_are_not_corrected() -> None:
    ladder = corrected(0.0)
    assert not ladder.table[-1].kept and ladder.correction is None


@pytest.mark.parametrize('count', [0, 19])
def test_few_starts_are_not_enough(count: int) -> None:
    laws = Laws(true_scene())
    found = pieces(launched(4), GIVEN, ['0'], laws.models, NOISE)[: 4 if count else 1]
    fold = Fold(stretches(found, laws.models, NOISE), found[:2] if count else [])
    ladder = Ladder(laws, [fold], Setup((), 'none', np.inf, (NOISE, 1e-4, 1e-3)))
    ladder.begin()
    assert ladder.correct() is None and len(ladder.table) == 1
