# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What balls that roll show of their surface, and what they must not seem to show: bounces."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_gns_core import Plane, Scene
from rigid_gns_core.data.tracks import Track
from rigid_gns_core.identification import elimination
from rigid_gns_core.identification.first_look import shown_bounces
from rigid_gns_core.identification.joint_fit import JointFit
from rigid_gns_core.identification.parameters import Laws
from rigid_gns_core.identification.shown_planes import placed_surfaces
from rigid_gns_core.identification.stretches import pieces, stretches
from rigid_gns_core.scenes.state import Array

RADIUS, NOISE, GRAVITY = 0.05, 0.004, 9.81
SCENE = Scene(surfaces=(Plane(),), radius=RADIUS, mass=0.9)


def rolling(height: float, slope: float, count: int = 6) -> list[Track]:
    """Balls that slow down on a surface that rises along x, 30 times a second."""
    rng, tracks = np.random.default_rng(3), []
    times = np.arange(60) / 30.0
    for k in range(count):
        way = rng.uniform(1.5, 2.5) * times - 0.15 * times**2
        turn = rng.uniform(-0.5, 0.5)
        x, y = way * np.cos(turn), way * np.sin(turn)
        tracks.append(tracked(k, times, x, y, RADIUS + height + slope * x, rng))
    return tracks


def thrown(count: int = 6) -> list[Track]:
    """Balls that fly low over the surface, and do not touch it."""
    rng, tracks = np.random.default_rng(4), []
    times = np.arange(16) / 30.0
    for k in range(count):
        high = RADIUS + 0.01 + 2.5 * times - 0.5 * GRAVITY * times**2
        tracks.append(tracked(k, times, 3.0 * times, 0.0 * times, high, rng))
    return tracks


def tracked(
    number: int, times: Array, x: Array, y: Array, z: Array, rng: np.random.Generator
) -> Track:
    places = np.stack([x, y, z], axis=1) + rng.normal(0.0, NOISE, (len(times), 3))
    return Track(str(number), times, places[:, None], None, ('0',))


def test_balls_that_roll_show_height_and_tilt_of_their_surface() -> None:
    scene, notes = placed_surfaces(SCENE, rolling(0.006, 0.01), ['0'], NOISE)
    # 40 places of 8 frames each, over 4 m: 0.2 mm and 1e-4
    plane = scene.surfaces[0]
    assert abs(plane.point[2] - 0.006) < 1e-3
    np.testing.assert_allclose(plane.normal, (-0.01, 0.0, 1.0), atol=6e-4)
    assert len(notes) == 1 and notes[0].startswith('surface 0: balls that roll or rest')
    assert '0.57 degrees' in notes[0] or '0.58 degrees' in notes[0] or '0.56 degrees' in notes[0]


@pytest.mark.parametrize('tracks', [rolling(0.001, 0.001), rolling(0.0, 0.0, 2), thrown()])
def test_a_surface_stays_where_it_is_given_unless_balls_are_seen_off_it(
    tracks: list[Track],
) -> None:
    """Where they are within its noise, are too few, or fly."""
    assert placed_surfaces(SCENE, tracks, ['0'], NOISE) == (SCENE, ())


def test_a_ball_that_rolls_does_not_bounce() -> None:
    """At 30 Hz parabolas under gravity on both sides of any low frame made a bounce of it."""
    laws = Laws(SCENE)
    found = pieces(rolling(0.0, 0.0), SCENE, ['0'], laws.models, NOISE)
    assert found and not len(shown_bounces(laws, found, 0))


def test_a_stretch_whose_slopes_overflow_tells_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Slopes through many slow impacts grow beyond all digits: the matrix was singular."""
    laws = Laws(SCENE)
    found = stretches(
        pieces(rolling(0.0, 0.0), SCENE, ['0'], laws.models, NOISE), laws.models, NOISE
    )
    fit = JointFit(laws, found[:2], np.array([NOISE, 1e-4, 0.02]), None)
    free = [laws.start_of('contact 0.rolling_friction')]
    values = {'contact 0.rolling_friction': free[0].start}
    starts, _ = fit.solve(values, None)
    alone = elimination.eliminated(fit.part(np.array([0])), free, values, starts[:1])
    whole = elimination.normal_equations

    def overflowing(start: Array, *arguments: object) -> tuple[float, float]:
        told = whole(start, *arguments)
        if np.array_equal(start, starts[1]):
            matrix, vector = arguments[-2:]
            assert isinstance(matrix, np.ndarray) and isinstance(vector, np.ndarray)
            matrix[:], vector[:] = 2.0**80, 2.0**40
        return told

    monkeypatch.setattr(elimination, 'normal_equations', overflowing)
    both = elimination.eliminated(fit, free, values, starts)
    np.testing.assert_array_equal(both.matrix, alone.matrix)
    np.testing.assert_array_equal(both.vector, alone.vector)
    inverse, gradient, cross = both.blocks[1]
    np.testing.assert_allclose(inverse @ fit.precisions[1], np.eye(9), atol=1e-6)
    assert not gradient.any() and not cross.any()
