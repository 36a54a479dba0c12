# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What can be told of a pile that chaos does not drown: one frame, energy, rest, and the heap."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from .accuracy import energies
from .interleaved import PeerRecord
from .peers import Peer
from .scenes import BenchScene, FRAME
from ...errors import UserError
from ...scenes.state import Array, State, Trajectory

TRUE_FRAMES = (20, 30, 40, 50, 60, 80)
"""Frames of the reference from which each peer takes one."""
ENERGY_FRAMES = (20, 40, 60, 100)
STILL = 0.01
"""Way of a sphere in a frame below which it is at rest [m]."""
TOUCHING = 0.02
"""Gap up to which two spheres count as neighbours [m]."""


def settle(scene: BenchScene, record: PeerRecord, reference: Trajectory | None) -> dict[str, Any]:
    """Measures of a peer in a pile.

    Returns:
        `frame_error`, see `frame_error`; `energy`, shares of that of the start after
        `ENERGY_FRAMES`; `at_rest`, share of spheres at rest in the last frame; `rest_time`, from
        when on nine of ten are [s], None where they are not; `height`, mean height of the centres
        at the end [m]; `neighbours`, mean number of each at the end.
    """
    positions = np.stack(record.positions)
    energy = energies(scene, positions)
    moves = np.linalg.norm(np.diff(positions, axis=0), axis=2)
    restless = np.flatnonzero((moves < STILL).mean(axis=1) < 0.9)
    calm = 0 if not len(restless) else int(restless[-1]) + 1
    last = positions[-1]
    finite = bool(np.isfinite(last).all())
    pairs = len(cKDTree(last).query_pairs(2.0 + TOUCHING)) if finite else np.nan
    return {
        'frame_error': None if reference is None else frame_error(scene, record.peer, reference),
        'energy': {
            str(frame): float(energy[frame] / energy[0])
            for frame in ENERGY_FRAMES
            if frame < len(energy)
        },
        'at_rest': float((moves[-1] < STILL).mean()),
        'rest_time': calm * FRAME if calm < len(moves) else None,
        'height': float((last @ scene.scene.up).mean()),
        'neighbours': 2.0 * pairs / len(last),
    }


def frame_error(scene: BenchScene, peer: Peer, reference: Trajectory) -> float | None:
    """Mean error of the positions one frame after states of the reference [m].

    None where the peer refuses or diverges.
    """
    errors = []
    for frame in (frame for frame in TRUE_FRAMES if frame < len(reference.positions) - 1):
        names = ('positions', 'quaternions', 'velocities', 'angular_velocities')
        state = State(**{name: getattr(reference, name)[frame] for name in names})
        try:
            run = peer.start(scene.scene, state)
        except UserError:
            return None
        try:
            after: Array = run.advance()
        except FloatingPointError:
            return None
        finally:
            run.close()
        apart = after - reference.positions[frame + 1]
        errors.append(float(np.linalg.norm(apart, axis=1).mean()))
    return float(np.mean(errors)) if errors else None
