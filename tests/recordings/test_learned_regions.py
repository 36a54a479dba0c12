# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Regions fitted to distances of known distributions, and judged on others of the same."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_gns_core.recordings.scoring.learned_regions import fit_regions
from rigid_gns_core.recordings.scoring.track_errors import Outcome
from rigid_gns_core.scenes.regions import Regions
from rigid_gns_core.scenes.state import Array


def outcomes(distances: Array, horizon: float, tracks: int) -> list[Outcome]:
    return [
        Outcome(f'{k % tracks}', '0', 0.0, horizon, horizon, 0.1, 0, False, None, float(distance))
        for k, distance in enumerate(distances)
    ]


def student(rng: np.random.Generator, count: int, scale: float) -> Array:
    """Distances of a Student distribution of 3 degrees."""
    normal = np.linalg.norm(rng.normal(size=(count, 3)), axis=1)
    return np.asarray(scale * normal / np.sqrt(rng.chisquare(3, count) / 3))


def held(regions: Regions, distances: Array, time: float) -> list[float]:
    return [float((distances <= regions.radii(p, [time])[0]).mean()) for p in (0.5, 0.9)]


def test_both_regions_hold_their_parts_at_each_horizon_under_heavy_tails() -> None:
    """Within 4 %: 1 % is the standard error, and 400 tracks leave 2 % of what others tell."""
    rng = np.random.default_rng(0)
    found = outcomes(student(rng, 3000, 0.7), 0.2, 400)
    found += outcomes(student(rng, 3000, 1.6), 1.0, 400)
    regions = fit_regions(found)
    for horizon, scale in ((0.2, 0.7), (1.0, 1.6)):
        half, most = held(regions, student(rng, 4000, scale), horizon)
        assert abs(half - 0.5) < 0.04 and abs(most - 0.9) < 0.04


def test_in_a_plane_both_regions_hold_their_parts() -> None:
    """Errors of balls on a table have two degrees of freedom: normal regions hold 69 and 96 %."""
    rng = np.random.default_rng(1)
    flat = np.linalg.norm(rng.normal(size=(6000, 2)), axis=1)
    regions = fit_regions(outcomes(flat[:2000], 0.4, 100))
    half, most = held(regions, flat[2000:], 0.4)
    assert abs(half - 0.5) < 0.03 and abs(most - 0.9) < 0.03


@pytest.mark.parametrize(('tracks', 'least', 'largest'), [(2, 1.0, 1.5), (200, 1.9, 2.1)])
def test_few_tracks_are_believed_less(tracks: int, least: float, largest: float) -> None:
    """Normal errors of twice the size: 2 tracks count a third beside what is known beforehand."""
    rng = np.random.default_rng(2)
    normal = 2.0 * np.linalg.norm(rng.normal(size=(2000, 3)), axis=1)
    ((_, half, most),) = fit_regions(outcomes(normal, 0.4, tracks)).rows
    assert least < half < largest and least < most < largest
