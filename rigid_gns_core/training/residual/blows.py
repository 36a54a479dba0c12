# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""States after blows, for samples that a blow is in the middle of.

A real contact takes time, and a frame that ends in the middle of one shows a velocity between
those before and after it, which says nothing of what a rigid blow did, and which a tracker hardly
knows. A network that learns such velocities as results takes half a blow for a whole one, and one
that learns what follows them pushes again what has already left. So a sphere in a blow is given
the state that it flies back to from the first sample after it, m h later:

    v = v_m - m h g,   x = x_m - m h v_m + (m h)^2 g / 2,   w = w_m.
"""

from __future__ import annotations

import numpy as np

from .smoothing import near
from ...kernels.neighbours import Flags
from ...scenes.scene import Scene
from ...scenes.state import State

# gaps [radii] up to which spheres may be in contact: noise of a tracker
_TOUCHING = 0.01
# change of a velocity over two samples beyond flight that is a blow, as of a fall [sqrt(g r)]
_BLOW = 0.16
# samples that a blow takes at most
_LONGEST = 3


def states_after_blows(scene: Scene, states: State, h: float) -> tuple[State, Flags]:
    """States at all samples, with blows completed, and where they are known.

    Args:
        scene: Surfaces, radii and gravity.
        states: Stacked states: fields of shape (m, n, k).
        h: Time between samples.

    Returns:
        The states, and flags of shape (m, n): false in blows that do not end in a few samples.
    """
    gravity = np.asarray(scene.gravity, dtype=np.float64)
    x, v = states.positions.copy(), states.velocities.copy()
    w = states.angular_velocities.copy()
    known = ~blows_of(scene, states, h)
    is_free = known.copy()
    for m in range(1, _LONGEST + 1):
        ends = np.zeros_like(known)
        ends[:-m] = is_free[m:]
        k, i = np.nonzero(~known & ends)
        later, time = k + m, m * h
        v[k, i] = states.velocities[later, i] - time * gravity
        x[k, i] = (
            states.positions[later, i]
            - time * states.velocities[later, i]
            + 0.5 * time**2 * gravity
        )
        w[k, i] = states.angular_velocities[later, i]
        known[k, i] = True
    return State.unchecked(x, states.quaternions, v, w), known


def blows_of(scene: Scene, states: State, h: float) -> Flags:
    """Whether a sphere is in the middle of a blow; shape (m, n). See `states_after_blows`."""
    gravity = np.asarray(scene.gravity, dtype=np.float64)
    radius = scene.per_sphere('radius', states.positions.shape[1])
    size = float(radius.mean())
    weight = float(np.linalg.norm(gravity)) or 9.81
    change = np.zeros(states.positions.shape[:2])
    beyond = states.velocities[2:] - states.velocities[:-2] - 2.0 * h * gravity
    change[1:-1] = np.linalg.norm(beyond, axis=-1)
    is_near = near(scene, states.positions, radius, _TOUCHING * size)
    found: Flags = is_near & (change > _BLOW * np.sqrt(weight * size))
    return found
