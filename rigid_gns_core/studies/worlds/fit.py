# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Laws fitted to the tracks of a world, by the error that the study judges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from .worlds import MATERIALS, Observed, SAMPLES
from ...rollout.simulator import Simulator
from ...scenes.scene import Scene
from ...scenes.state import State
from ...training.residual.smoothing import smoothed_states

# frames of a window, and evaluations of the error
_FRAMES, _EVALUATIONS = 3, 60
# first changes of restitution, friction and rolling friction of the materials
_STEPS = (-0.06, -0.12, 0.02)


def fit_laws(laws: Simulator, tracks: Sequence[Observed], windows: int, seed: int) -> Scene:
    """Scene whose materials predict the tracks best, by the mean position error after 0.3 s.

    Restitution, friction and rolling friction, by the simplex search of Nelder and Mead; it is
    the measure that the network is judged by, so that nothing but a law is missing.

    Args:
        laws: The laws.
        tracks: What was tracked.
        windows: Starts, drawn from all tracks.
        seed: Of that draw.
    """
    rng, starts = np.random.default_rng([seed, 4]), []
    for index in rng.integers(0, len(tracks), windows):
        one = tracks[index]
        tracked = one.tracked
        states = smoothed_states(one.scene, tracked.positions, tracked.quaternions, tracked.dt)
        sample = int(rng.integers(0, len(tracked) - _FRAMES * SAMPLES))
        after = states.positions[sample + _FRAMES * SAMPLES]
        values = (getattr(states, name)[sample] for name in _STATE)
        starts.append((one.scene, State.unchecked(*values), after))

    def error(values: np.ndarray) -> float:
        restitution, friction, rolling = np.clip(values, 0.0, (1.0, 3.0, 1.0))
        errors = []
        for scene, start, after in starts:
            changed = replace(
                scene, restitution=restitution, friction=friction, rolling_friction=rolling
            )
            found = laws.rollout(changed, steps=_FRAMES, **vars(start))
            errors.append(np.linalg.norm(found.positions[-1] - after, axis=1))
        return float(np.mean(np.concatenate(errors)))

    first = np.array([float(np.mean(getattr(tracks[0].scene, name))) for name in MATERIALS])
    simplex = np.vstack([first, first + np.diag(_STEPS)])
    found = minimize(
        error,
        first,
        method='Nelder-Mead',
        options={'initial_simplex': simplex, 'maxfev': _EVALUATIONS},
    )
    best = np.clip(found.x, 0.0, (1.0, 3.0, 1.0))
    restitution, friction, rolling = map(float, best)
    return replace(
        tracks[0].scene, restitution=restitution, friction=friction, rolling_friction=rolling
    )


_STATE = ('positions', 'quaternions', 'velocities', 'angular_velocities')
