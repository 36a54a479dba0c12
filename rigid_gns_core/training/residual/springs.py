# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Springs of blows from tracks: those with which the laws predict three frames best.

Stiffness k, factors of restitution and friction, and the ratio q of the springs across and along
the normal; see `engine/springs.py`. The simplex search of Nelder and Mead (1965) begins with the
best of some k, and other windows of the tracks decide whether blows are left to the laws.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
import math

import numpy as np
from scipy.optimize import minimize
import torch

from .frames import Track
from ...engine.learned_network import LearnedNetwork, network_of
from ...engine.learned_stepper import LearnedStepper
from ...engine.options import LawsOptions, ResidualConfig
from ...engine.springs import SPRINGS
from ...files.checkpoint import tensors_of
from ...networks.residual import ResidualNetwork
from ...prediction.laws import UNITS
from ...scenes.state import Array

# frames of a window, and evaluations of the error
_FRAMES, _EVALUATIONS = 3, 60
# k of the first tries [1/s^2]: contacts of 100, 57, 31, 18 and 10 ms where a frame is 100 ms
_FIRST = (1e3, 3e3, 1e4, 3e4, 1e5)
# log k, factors of restitution and friction, q: where the search begins, first changes, bounds
_BEGIN, _STEPS = (1.0, 1.0, 0.5), (0.3, -0.1, -0.2, 0.3)
_LEAST = np.array([math.log(3e2), 0.2, 0.0, 0.02])
_MOST = np.array([math.log(2e5), 1.5, 3.0, 1.0])
# error over that of the laws from which on springs are used
_WINS = 0.98


def fit_springs(tracks: Sequence[Track], windows: int, seed: int) -> Array:
    """Springs of the tracks; zeros: the laws predict other windows as well.

    Args:
        tracks: What was observed.
        windows: Starts to fit to, drawn from all tracks, and as many others that decide.
        seed: Of that draw.

    Returns:
        Shape (SPRINGS,), model units.
    """
    long = [track for track in tracks if track.last_start(_FRAMES) >= 0]
    none = np.zeros(SPRINGS)
    if not long or not windows:
        return none
    rng = np.random.default_rng([seed, 6])
    drawn = [long[k] for k in rng.integers(0, len(long), 2 * windows)]
    starts = [(one, int(rng.integers(0, one.last_start(_FRAMES) + 1))) for one in drawn]
    fitted, others = starts[:windows], starts[windows:]

    def springs_of(values: Array) -> Array:
        log, *rest = np.clip(values, _LEAST, _MOST)
        return np.array([math.exp(log), *rest])

    def error(values: Array) -> float:
        return _error(springs_of(values), fitted)

    first = min((np.array([math.log(k), *_BEGIN]) for k in _FIRST), key=error)
    simplex = np.vstack([first, first + np.diag(_STEPS)])
    found = minimize(
        error,
        first,
        method='Nelder-Mead',
        options={'initial_simplex': simplex, 'maxfev': _EVALUATIONS},
    )
    best = springs_of(found.x)
    return best if _error(best, others) < _WINS * _error(none, others) else none


def _error(springs: Array, starts: Sequence[tuple[Track, int]]) -> float:
    """Mean position error over spheres after the frames of a window [radii]."""
    network, errors = _springs_alone(springs), []
    for track, sample in starts:
        stepper = LearnedStepper(
            network, track.scene, track.at(sample), UNITS.dt, **asdict(LawsOptions())
        )
        made = stepper.advance(_FRAMES).states.positions[-1]
        seen = track.at(sample + _FRAMES * track.samples).positions
        errors.append(np.linalg.norm(made - seen, axis=1))
    mean = float(np.mean(np.concatenate(errors)))
    return mean if math.isfinite(mean) else math.inf


def _springs_alone(springs: Array) -> LearnedNetwork:
    """Weights that do nothing but follow springs; the laws where they are 0."""
    config = ResidualConfig(width=1, vectors=1)
    network = ResidualNetwork(config)
    with torch.no_grad():
        network.springs.copy_(torch.as_tensor(springs))
        network.stiffness.fill_(springs[0])
        network.strength.zero_()
    return network_of(tensors_of(network), config)
