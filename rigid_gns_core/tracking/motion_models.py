# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How spheres may move, and which motion explains a window at the least cost."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .jit import in_place
from .line_fit import fit_line, Flags
from ..kernels.vector import plus, put, Vector
from ..scenes.state import Array

Indices = NDArray[np.int64]

# NumPy's integers: of Python's, compiled code would have a copy for each value
FLIGHT, ROLLING, UNIFORM = np.int64(0), np.int64(1), np.int64(2)
# charge for a frame left out: one that fits costs 3 on average, and over 12 once in 140
OUTLIER = 12.0


@dataclass(frozen=True)
class Motion:
    """Spheres at the last frame of a window.

    Args:
        positions: Centres [m], shape (n, 3).
        quaternions: Rotations (x, y, z, w), shape (n, 4).
        velocities: [m/s], shape (n, 3).
        angular_velocities: [rad/s], world frame, shape (n, 3).
        kinds: FLIGHT, ROLLING on a surface, or UNIFORM, as held by others, shape (n,).
        frames: Number of frames that the motion explains, shape (n,).
        errors: Standard deviation of each component of velocity that noise gives [m/s], shape
            (n,).
    """

    positions: Array
    quaternions: Array
    velocities: Array
    angular_velocities: Array
    kinds: NDArray[np.int64]
    frames: NDArray[np.int64]
    errors: Array

    @classmethod
    def unknown(cls, poses: Array) -> Motion:
        """Spheres at poses of shape (n, 7), of whose motion nothing is known yet."""
        none = np.zeros((len(poses), 3))
        ones = np.ones(len(poses), dtype=np.int64)
        far = np.full(len(poses), np.inf)
        return cls(poses[:, :3], poses[:, 3:], none, none, np.zeros_like(ones), ones, far)

    def part(self, keep: NDArray[np.bool_]) -> Motion:
        """Return some of the spheres."""
        return Motion(**{name: value[keep] for name, value in vars(self).items()})

    def joined(self, other: Motion) -> Motion:
        """Return these spheres, then those of another."""
        fields = vars(self).items()
        return Motion(**{n: np.concatenate([value, getattr(other, n)]) for n, value in fields})


class Hypothesis(NamedTuple):
    """One hypothesis of a sphere's motion in its window.

    Args:
        cost: Squared residuals in units of the noise, and charges; infinite where there is none.
        origin: Place at the last frame, less where the sphere was seen last, and less the fall
            [m].
        slope: Velocity at the last frame [m/s].
        frames: Number of frames explained.
        error: Standard deviation of each component of velocity [m/s].
    """

    cost: float
    origin: Vector
    slope: Vector
    frames: int
    error: float


class Contact(NamedTuple):
    """What changed a motion.

    Args:
        frame: The first after it.
        time: Of the contact [s].
        angle: Rotation vector at the contact [rad].
        law: Spin after it, by the law of impact [rad/s].
    """

    frame: int
    time: float
    angle: Vector
    law: Vector


class Hypotheses(NamedTuple):
    """The cheapest hypothesis found so far, for each sphere.

    Args:
        cost: As in `Hypothesis`, shape (n,).
        origins: Shape (n, 3).
        slopes: Shape (n, 3).
        kinds: Of motion, shape (n,).
        begin: First frame since a contact, shape (n,).
        frames: Number of frames explained, shape (n,).
        errors: Standard deviations of velocity [m/s], shape (n,).
        struck: Whether it begins with a `Contact`, whose fields follow, shape (n,).
        times: Shape (n,).
        angles: Shape (n, 3).
        laws: Shape (n, 3).
    """

    cost: Array
    origins: Array
    slopes: Array
    kinds: Indices
    begin: Indices
    frames: Indices
    errors: Array
    struck: Flags
    times: Array
    angles: Array
    laws: Array

    @classmethod
    def at_rest(cls, seen: Flags, last: Indices) -> Hypotheses:
        """At rest where last seen, all other frames outliers; as in `Observations`."""
        n = len(last)
        return cls(
            cost=OUTLIER * (seen.sum(axis=1) - 1.0) + 1e-9,
            origins=np.zeros((n, 3)),
            slopes=np.zeros((n, 3)),
            kinds=np.full(n, FLIGHT),
            begin=last.copy(),
            frames=np.ones(n, dtype=np.int64),
            errors=np.full(n, np.inf),
            struck=np.zeros(n, dtype=bool),
            times=np.zeros(n),
            angles=np.zeros((n, 3)),
            laws=np.zeros((n, 3)),
        )


@in_place
def take(best: Hypotheses, i: int, found: Hypothesis, kind: np.int64, begin: int) -> bool:
    """Replace the hypothesis of sphere i where it costs more; whether it did."""
    if not found.cost < best.cost[i]:
        return False
    best.cost[i] = found.cost
    put(best.origins, i, found.origin)
    put(best.slopes, i, found.slope)
    best.kinds[i], best.begin[i], best.frames[i] = kind, begin, found.frames
    best.errors[i], best.struck[i] = found.error, False
    return True


@in_place
def try_tail(
    best: Hypotheses,
    i: int,
    sums: Array,
    begin: int,
    sigma: float,
    kind: np.int64,
    extra: float,
    off: Vector,
) -> None:
    """Try the frames from `begin` on as one motion.

    Args:
        best: Takes it where it costs less.
        i: Of the sphere.
        sums: Of its places, less the known acceleration, as `accumulate` makes them.
        begin: First frame of the motion.
        sigma: Noise [m].
        kind: Of motion.
        extra: Charge.
        off: From the line to the sphere's centre [m].
    """
    line = fit_line(sums, begin, len(sums) - 1)
    if line.seen < 1.5:
        return
    cost = line.misfit / sigma**2 + OUTLIER * (sums[-1, 0] - line.seen) + extra
    error = sigma / math.sqrt(line.span)
    found = Hypothesis(cost, plus(line.origin, off), line.slope, int(line.seen), error)
    take(best, i, found, kind, begin)


@in_place
def try_contact(
    best: Hypotheses, i: int, found: Hypothesis, kind: np.int64, contact: Contact
) -> None:
    """Try a motion that begins with a contact."""
    if take(best, i, found, kind, contact.frame):
        best.struck[i], best.times[i] = True, contact.time
        put(best.angles, i, contact.angle)
        put(best.laws, i, contact.law)
