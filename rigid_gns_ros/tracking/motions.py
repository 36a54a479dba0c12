"""How spheres may move, and which motion explains a window at the least cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid_gns_core.state import Array

from .stretches import Lines

FLIGHT, CARRIED, AMONG = 0, 1, 2
# charge for a frame left out: one that fits costs 3 on average, and over 12 once in 140
LEFT_OUT = 12.0


@dataclass(frozen=True)
class Motion:
    """Spheres at the last frame of a window.

    Args:
        positions: Centres [m], shape (n, 3).
        quaternions: Rotations (x, y, z, w), shape (n, 4).
        velocities: [m/s], shape (n, 3).
        angular_velocities: [rad/s], world frame, shape (n, 3).
        kinds: FLIGHT, CARRIED by a surface, or held AMONG others, shape (n,).
        frames: Number of frames that the motion explains, shape (n,).
        errors: Standard deviation of each component of velocity that noise gives [m/s], shape (n,).
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
        """Some of the spheres."""
        return Motion(**{name: value[keep] for name, value in vars(self).items()})

    def joined(self, other: Motion) -> Motion:
        """These spheres, then those of another."""
        fields = vars(self).items()
        return Motion(**{n: np.concatenate([value, getattr(other, n)]) for n, value in fields})


class Flight(NamedTuple):
    """Motions after contacts, of n spheres; origins and slopes as in `Lines`.

    Args:
        cost: Infinite where there is none, shape (..., n).
        origins: Shape (..., n, 3).
        slopes: Shape (..., n, 3).
        frames: Number of frames explained, shape (..., n).
        errors: Standard deviation of each component of velocity [m/s], shape (..., n).
    """

    cost: Array
    origins: Array
    slopes: Array
    frames: NDArray[np.int64]
    errors: Array


@dataclass
class Best:
    """The cheapest motion found so far, for each sphere.

    Args:
        cost: Squared residuals in units of the noise, and charges, shape (n,).
        origins: Places at the last frame, less where the sphere was seen last [m], shape (n, 3).
        slopes: Velocities at the last frame [m/s], shape (n, 3).
        kinds: Of motion, shape (n,).
        begin: First frame since a contact, shape (n,).
        frames: Number of frames explained, shape (n,).
        errors: Standard deviations of velocity [m/s], shape (n,).
        rebound: Frame after a contact, negative where it is with a sphere; else 0; shape (n,).
    """

    cost: Array
    origins: Array
    slopes: Array
    kinds: NDArray[np.int64]
    begin: NDArray[np.int64]
    frames: NDArray[np.int64]
    errors: Array
    rebound: NDArray[np.int64]

    @classmethod
    def none(cls, seen: NDArray[np.bool_]) -> Best:
        """At rest where last seen, with all other frames left out; seen has shape (frames, n)."""
        n = seen.shape[1]
        last = len(seen) - 1 - np.argmax(seen[::-1], axis=0)
        return cls(
            cost=LEFT_OUT * (seen.sum(axis=0) - 1.0) + 1e-9,
            origins=np.zeros((n, 3)),
            slopes=np.zeros((n, 3)),
            kinds=np.zeros(n, dtype=np.int64),
            begin=last,
            frames=np.ones(n, dtype=np.int64),
            errors=np.full(n, np.inf),
            rebound=np.zeros(n, dtype=np.int64),
        )

    def take(self, cost: Array, **values: ArrayLike) -> None:
        """Replace what costs more."""
        better = cost < self.cost
        self.cost = np.where(better, cost, self.cost)
        for name, value in values.items():
            old = getattr(self, name)
            setattr(self, name, np.where(better[:, None] if old.ndim == 2 else better, value, old))

    def take_tails(self, lines: Lines, sigma: Array, kind: int, extra: Array) -> None:
        """Try each tail of the window as one motion, at an extra charge, shape (n,)."""
        left_out = LEFT_OUT * (lines.counts[0] - lines.counts)
        cost = lines.misfits.sum(axis=-1) / sigma**2 + left_out + extra
        cost = np.where(lines.counts > 1.5, cost, np.inf)
        begin = cost.argmin(axis=0)
        rows = begin, np.arange(len(sigma))
        with np.errstate(divide='ignore'):
            errors = sigma / np.sqrt(lines.spans[rows])
        self.take(
            cost[rows],
            origins=lines.origins[rows],
            slopes=lines.slopes[rows],
            kinds=kind,
            begin=begin,
            frames=lines.counts[rows].astype(np.int64),
            errors=errors,
            rebound=0,
        )

    def take_contact(
        self, after: Flight, frame: int, name: int, kinds: NDArray[np.int64], extra: Array
    ) -> None:
        """Try motions after a contact in front of a frame; `name` is what `rebound` gets."""
        self.take(
            after.cost + extra,
            origins=after.origins,
            slopes=after.slopes,
            kinds=kinds,
            begin=frame,
            frames=after.frames,
            errors=after.errors,
            rebound=name,
        )
