# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracks of a launcher of table tennis balls whose laws and values are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rigid_gns_core import Air, ContactLaw, Plane, Scene
from rigid_gns_core.data.tracks import Track
from rigid_gns_core.tracking.ball_contact import FREE
from rigid_gns_core.tracking.ball_model import BallModel
from rigid_gns_core.tracking.ball_path import path

NOISE = 0.7e-3
TRUE = {
    'contact 0.restitution': 0.93,
    'contact 0.friction': 0.22,
    'air.drag_coefficient': 0.42,
    'air.lift_coefficient': 0.4,
    'surface 0.height': 0.002,
}
GIVEN = Scene(
    surfaces=Plane(contact=ContactLaw(restitution=0.8, friction=0.3)),
    radius=0.02,
    mass=0.0027,
    inertia_factor=2 / 3,
)


def true_scene() -> Scene:
    law = ContactLaw(restitution=TRUE['contact 0.restitution'], friction=0.22)
    table = replace(GIVEN.surfaces[0], point=(0.0, 0.0, 0.002), contact=law)
    return replace(GIVEN, surfaces=table, air=Air(drag_coefficient=0.42, lift_coefficient=0.4))


def launched(count: int, seed: int = 0, cross: float = 0.0) -> list[Track]:
    """Shots of a launcher with topspin and some side spin, at 180 Hz with noise.

    A force that no scene has accelerates them across by `cross` times their speed over 4.5 m/s.
    """
    rng = np.random.default_rng(seed)
    times = np.arange(150) / 180.0
    tracks = []
    for number in range(count):
        place = rng.normal([0.0, 0.0, 0.35], [0.02, 0.02, 0.01])
        velocity = rng.normal([4.5, 0.0, 1.0], [0.4, 0.15, 0.2])
        spin = rng.normal([0.0, 90.0, 25.0], [15.0, 30.0, 15.0])
        states = np.zeros((len(times), 9))
        hidden = cross * (velocity[0] - 4.5)
        model = BallModel.of(replace(true_scene(), gravity=(0.0, hidden, -9.81)))
        laws = (model.ball, model.planes, model.laws)
        start = np.concatenate([place, velocity, spin])
        path(start, 0.0, times, *laws, FREE, states, np.zeros((8, 3)))
        places = states[:, None, :3] + rng.normal(0.0, NOISE, (len(times), 1, 3))
        tracks.append(Track(f'{number}', times, places, None, ('0',)))
    return tracks
