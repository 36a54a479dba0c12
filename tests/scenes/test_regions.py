# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sizes of regions of forecasts, against chi-squared and Student's distribution."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_gns_core.scenes.regions import NORMAL, normal_radius, PARTS, Regions
from scipy.stats import chi2, f


def test_normal_regions_are_those_of_chi_squared() -> None:
    for probability in (0.1, 0.5, 0.9, 0.99):
        radius = np.sqrt(chi2.ppf(probability, 3))
        np.testing.assert_allclose(NORMAL.radii(probability, [0.1, 2.0]), radius, rtol=1e-12)
        assert abs(NORMAL.probability(float(radius), 0.7) - probability) < 1e-12


def test_factors_hold_at_their_times_and_probabilities_and_in_between() -> None:
    regions = Regions(((0.2, 0.8, 1.5), (0.8, 1.25, 1.5)))
    for part, at in zip(PARTS, ([0.8, 1.0, 1.25], [1.5, 1.5, 1.5]), strict=True):
        # by the logarithm half way in time, and no farther than told
        found = regions.radii(part, [0.1, 0.5, 3.0]) / normal_radius(part)
        np.testing.assert_allclose(found, at, rtol=1e-12)
    for probability in (0.2, 0.5, 0.7, 0.95):
        radius = float(regions.radii(probability, [0.4])[0])
        assert abs(regions.probability(radius, 0.4) - probability) < 1e-12


def test_heavy_tails_are_nearly_a_power() -> None:
    """A Student distribution of 4 degrees, told at 50 and 90 %: elsewhere within 5 %."""
    radii = np.sqrt(3.0 * f.ppf([*PARTS, 0.25, 0.75, 0.95], 3, 4))
    half, most = (radii[:2] / normal_radius(PARTS)).tolist()
    regions = Regions(((1.0, half, most),))
    for probability, radius in zip((0.25, 0.75, 0.95), radii[2:], strict=True):
        assert abs(regions.probability(float(radius), 1.0) - probability) < 0.05


@pytest.mark.parametrize(
    ('rows', 'message'),
    [
        ((), 'no rows of three numbers'),
        (((0.2, 1.0),), 'no rows of three numbers'),
        (((0.2, 1.0, 0.0),), 'not finite and above 0'),
        (((0.4, 1.0, 1.0), (0.2, 1.0, 1.0)), 'do not rise; sort the rows'),
        (((0.2, 2.0, 1.0),), 'of 90 % of a tracker is no larger than that of 50 %'),
    ],
)
def test_rows_are_checked(rows: tuple[tuple[float, ...], ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Regions(rows)
