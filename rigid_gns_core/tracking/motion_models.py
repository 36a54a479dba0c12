# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motion models of a sphere, and the hypotheses that explain its window."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .jit import in_place
from .line_fit import fit_line
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import plus, put, Vector
from ..scenes.state import Array, State

# NumPy's integers: of Python's, compiled code would have a copy for each value
FLIGHT, ROLLING, UNIFORM = np.int64(0), np.int64(1), np.int64(2)
# cost of a frame left out as an outlier; one that fits costs 3 on average, over 12 once in 140
OUTLIER = 12.0


@dataclass(frozen=True)
class Motion:
    """State of the spheres at the last frame of a window.

    Args:
        positions: Centres [m], shape (n, 3).
        quaternions: Rotations (x, y, z, w), shape (n, 4).
        velocities: Velocities [m/s], shape (n, 3).
        angular_velocities: Angular velocities [rad/s], world frame, shape (n, 3).
        kinds: FLIGHT, ROLLING on a surface, or UNIFORM where supported, shape (n,).
        frames: Number of frames that the motion explains, shape (n,).
        errors: Standard deviation of each component of velocity [m/s], from the noise, shape (n,).
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
        """Spheres at rest at poses of shape (n, 7); the errors of velocity are infinite."""
        none = np.zeros((len(poses), 3))
        ones = np.ones(len(poses), dtype=np.int64)
        far = np.full(len(poses), np.inf)
        return cls(poses[:, :3], poses[:, 3:], none, none, np.zeros_like(ones), ones, far)

    @property
    def state(self) -> State:
        """State of the spheres."""
        return State(
            positions=self.positions,
            quaternions=self.quaternions,
            velocities=self.velocities,
            angular_velocities=self.angular_velocities,
        )

    def part(self, keep: NDArray[np.bool_]) -> Motion:
        """The spheres where `keep` is true, shape (n,)."""
        return Motion(**{name: value[keep] for name, value in vars(self).items()})

    def joined(self, other: Motion) -> Motion:
        """These spheres followed by those of `other`."""
        fields = vars(self).items()
        return Motion(**{n: np.concatenate([value, getattr(other, n)]) for n, value in fields})


class Hypothesis(NamedTuple):
    """One hypothesis of a sphere's motion in its window.

    Args:
        cost: Squared residuals in units of the noise, plus charges; infinite where there is none.
        origin: Position at the last frame less the last measured one, without the fall [m].
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
    """A contact that changed the motion.

    Args:
        frame: First frame after the contact.
        time: Time of the contact [s].
        angle: Rotation vector at the contact [rad].
        spin_after: Spin after the contact, by the law of impact [rad/s].
    """

    frame: int
    time: float
    angle: Vector
    spin_after: Vector


class Hypotheses(NamedTuple):
    """The cheapest hypothesis so far of each sphere.

    Args:
        cost: As in `Hypothesis`, shape (n,).
        origins: As in `Hypothesis` [m], shape (n, 3).
        slopes: As in `Hypothesis` [m/s], shape (n, 3).
        kinds: Kind of motion, shape (n,).
        begin: First frame since the last contact, shape (n,).
        frames: Number of frames explained, shape (n,).
        errors: Standard deviations of velocity [m/s], shape (n,).
        struck: Whether the motion begins with a `Contact`, whose fields follow, shape (n,).
        contact_times: Times of the contacts [s], shape (n,).
        angles: Rotation vectors at the contacts [rad], shape (n, 3).
        spins_after: Spins after the contacts, by the law of impact [rad/s], shape (n, 3).
    """

    cost: Array
    origins: Array
    slopes: Array
    kinds: Indices
    begin: Indices
    frames: Indices
    errors: Array
    struck: Flags
    contact_times: Array
    angles: Array
    spins_after: Array

    @classmethod
    def at_rest(cls, seen: Flags, last: Indices) -> Hypotheses:
        """At rest where last seen, with all other frames as outliers.

        Args:
            seen: Whether a sphere was seen in a frame, shape (n, frames).
            last: Last frame that shows each sphere, shape (n,).
        """
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
            contact_times=np.zeros(n),
            angles=np.zeros((n, 3)),
            spins_after=np.zeros((n, 3)),
        )


@in_place
def keep_cheaper(
    best: Hypotheses, i: int, candidate: Hypothesis, kind: np.int64, begin: int
) -> bool:
    """Replace the hypothesis of sphere i by a cheaper one; whether it was replaced."""
    if not candidate.cost < best.cost[i]:
        return False
    best.cost[i] = candidate.cost
    put(best.origins, i, candidate.origin)
    put(best.slopes, i, candidate.slope)
    best.kinds[i], best.begin[i], best.frames[i] = kind, begin, candidate.frames
    best.errors[i], best.struck[i] = candidate.error, False
    return True


@in_place
def try_tail(
    best: Hypotheses,
    i: int,
    sums: Array,
    begin: int,
    sigma: float,
    kind: np.int64,
    charge: float,
    offset: Vector,
) -> None:
    """Try one motion through all frames from `begin` on.

    Args:
        best: Hypotheses, replaced where this one is cheaper.
        i: Index of the sphere.
        sums: Prefix sums of its positions without the known acceleration, see `accumulate`.
        begin: First frame of the motion.
        sigma: Noise [m].
        kind: Of motion.
        charge: Charge.
        offset: From the line to the sphere's centre [m].
    """
    line = fit_line(sums, begin, len(sums) - 1)
    if line.seen < 1.5:
        return
    cost = line.misfit / sigma**2 + OUTLIER * (sums[-1, 0] - line.seen) + charge
    error = sigma / math.sqrt(line.span)
    candidate = Hypothesis(cost, plus(line.origin, offset), line.slope, int(line.seen), error)
    keep_cheaper(best, i, candidate, kind, begin)


@in_place
def try_contact(
    best: Hypotheses, i: int, candidate: Hypothesis, kind: np.int64, contact: Contact
) -> None:
    """Try a motion that begins with a contact."""
    if keep_cheaper(best, i, candidate, kind, contact.frame):
        best.struck[i], best.contact_times[i] = True, contact.time
        put(best.angles, i, contact.angle)
        put(best.spins_after, i, contact.spin_after)
