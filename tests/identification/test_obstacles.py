# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Laws of contacts with obstacles, from synthetic tracks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core import ContactLaw, Obstacle, Plane, Scene, UserError
from rigid_gns_core.data.tracks import Track
from rigid_gns_core.identification.joint_fit import JointFit
from rigid_gns_core.identification.learn import learn
from rigid_gns_core.identification.parameters import Laws
from rigid_gns_core.identification.spins import broad_prior
from rigid_gns_core.identification.stretches import pieces, stretches
from rigid_gns_core.identification.terms import met_by
from rigid_gns_core.tracking.ball_contact import FREE
from rigid_gns_core.tracking.ball_model import BallModel
from rigid_gns_core.tracking.ball_path import path

NOISE = 0.7e-3
FLOOR = Plane(contact=ContactLaw(restitution=0.8, friction=0.3))
RIM = Obstacle('ring', (0.0, 0.0, 0.5), radius=0.15, thickness=0.012)
BOX = Obstacle('box', (0.0, 3.0, 0.1), size=(0.2, 0.2, 0.2))
TRUE = ContactLaw(restitution=0.7, friction=0.15)
GIVEN = Scene(
    surfaces=FLOOR,
    obstacles=(BOX, replace(RIM, contact=ContactLaw(restitution=0.55, friction=0.3))),
    radius=0.02,
    mass=0.0027,
)


def thrown_at_the_rim(count: int, frames: int = 60) -> list[Track]:
    """Shots that hit the rim before anything else, at 180 Hz with noise."""
    model = BallModel.of(replace(GIVEN, obstacles=(BOX, replace(RIM, contact=TRUE))))
    rng, times, tracks = np.random.default_rng(4), np.arange(frames) / 180.0, []
    while len(tracks) < count:
        start = np.concatenate(
            [
                rng.normal([-0.45, 0.0, 0.75], 0.02),
                rng.normal([1.5, 0.0, 0.4], [0.2, 0.1, 0.2]),
                rng.normal([0.0, 0.0, 0.0], 20.0),
            ]
        )
        states, impacts = np.zeros((len(times), 9)), np.zeros((8, 3))
        laws = (model.ball, model.planes, model.laws)
        met, _ = path(start, 0.0, times, *laws, FREE, states, impacts)
        if not met or impacts[0, 1] < 7 or not 0.1 < impacts[0, 0] < 0.25:
            continue
        places = states[:, None, :3] + rng.normal(0.0, NOISE, (len(times), 1, 3))
        tracks.append(Track(f'{len(tracks)}', times, places, None, ('0',)))
    return tracks


def test_the_restitution_of_a_rim_is_found_within_its_standard_error() -> None:
    """16 shots; three standard errors, which are below 0.02 for restitution and 0.05 for mu."""
    tracks, laws = thrown_at_the_rim(16), Laws(GIVEN)
    assert laws.groups == [[0], [1], [2]] and list(laws.rows[1]) == [1, 2, 3, 4, 5, 6]
    found = stretches(pieces(tracks, GIVEN, ['0'], laws.models, NOISE), laws.models, NOISE)
    assert len(found) >= 16  # a blow of the rim is no unknown one, at which tracks are cut
    met = met_by(laws, found, NOISE)
    assert met.impacts[2] >= 16 and met.impacts[1] == 0
    names = ('contact 2.restitution', 'contact 2.friction')
    noise = np.array([NOISE, 1e-6, 1e-4])
    fit = JointFit(laws, found, noise, broad_prior(0.02))
    fitted = fit.fit([laws.start_of(name) for name in names], {})
    for name, true, most in zip(names, (0.7, 0.15), (0.02, 0.05), strict=True):
        assert fitted.errors[name] < most
        assert abs(fitted.values[name] - true) < 3.0 * fitted.errors[name]
    scene = laws.scene_at(fitted.values)
    law = scene.obstacles[1].contact
    assert law is not None and law.restitution == fitted.values[names[0]]
    assert scene.obstacles[0] == BOX and scene.surfaces == GIVEN.surfaces


@pytest.mark.slow
def test_a_scene_with_obstacles_is_fitted() -> None:
    """Tracks of 0.8 s, which end on the floor; a ladder scores forecasts up to a second."""
    learned = learn(thrown_at_the_rim(12, 150), GIVEN, ['0'])
    told = learned.parameters['contact 2.restitution']
    assert abs(told.value - 0.7) < 4.0 * told.error
    assert any('contact 1 (obstacle 0): no ball meets it' in note for note in learned.notes)


def test_a_scene_with_a_racket_is_refused() -> None:
    racket = Plane((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), velocity=(0.0, 0.0, 1.0))
    with pytest.raises(UserError, match='surface 1 of the scene moves'):
        learn(thrown_at_the_rim(4), replace(GIVEN, surfaces=(FLOOR, racket)), ['0'])
