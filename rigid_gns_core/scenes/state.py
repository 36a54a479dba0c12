# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The state of spheres at one time, and a trajectory of states.

One place owns names, shapes, units and conventions: SI units, right-handed world frame, z up
(REP-103), quaternions as (x, y, z, w), angular velocities in the world frame. Arrays are float64;
networks convert their input to float32.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .values import checked_floats
from ..errors import UserError

Array = NDArray[np.float64]

# largest number of a scene or a state: the square of twice as much is still a number
LARGEST = 1e100
# distance of a norm from 1 up to which a vector of float64 is a unit vector: 9 eps / 2
UNIT = 1e-15


def _field(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    array = np.array(checked_floats(name, value))
    if array.shape != shape:
        raise UserError(f'{name} has shape {array.shape}, expected {shape}')
    if not (usable := np.abs(array) <= LARGEST).all():
        sphere = int(np.argwhere(~usable)[0][-2])
        found = array[~usable][0]
        reason = f'holds {found:g}' if np.isfinite(found) else 'is not finite'
        raise UserError(
            f'{name} of sphere {sphere} {reason}, expected numbers of at most {LARGEST:g}; '
            'remove or repair that sphere'
        )
    return array


def _unit_quaternions(value: ArrayLike, shape: tuple[int, ...]) -> Array:
    array = _field('quaternions', value, shape)
    norms = _norms(array)
    if (norms < 1e-6).any():
        sphere = int(np.argwhere(norms < 1e-6)[0][-2])
        raise UserError(
            f'quaternion of sphere {sphere} has norm {norms.min():.2g}, expected 1; '
            'use (0, 0, 0, 1) where a rotation is unknown'
        )
    return _over(array, norms)


def as_unit(vectors: Array) -> Array:
    """Vectors over their norms, shape (..., k); the same bits again for what this returned.

    Rounding leaves norms within 4 eps / 2 of 1, in the vector and in the norm computed of it.
    Divided again, a third of them would be other vectors: what is read back would not be what was
    written.
    """
    return _over(vectors, _norms(vectors))


def _norms(vectors: Array) -> Array:
    """Norms, shape (..., 1): as of np.linalg.norm to the bit, in a third of its time for few."""
    norms: Array = np.sqrt(np.add.reduce(vectors * vectors, axis=-1, keepdims=True))
    return norms


def _over(vectors: Array, norms: Array) -> Array:
    """Vectors over their norms, but for those that are unit vectors."""
    return np.where(np.abs(norms - 1.0) > UNIT, vectors / norms, vectors)


@dataclass(frozen=True, kw_only=True)
class State:
    """Spheres at one time.

    Args:
        positions: Centres [m], shape (n, 3).
        quaternions: Rotations (x, y, z, w), shape (n, 4). None: identity.
        velocities: Linear velocities [m/s], shape (n, 3). None: at rest.
        angular_velocities: Angular velocities [rad/s], world frame, shape (n, 3). None: no spin.

    Raises:
        UserError: A shape is wrong, a value is not finite, or a quaternion is zero.
    """

    positions: Array
    quaternions: Array = None  # type: ignore[assignment]
    velocities: Array = None  # type: ignore[assignment]
    angular_velocities: Array = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        positions = checked_floats('positions', self.positions)
        if positions.shape == (0,):  # an empty list
            positions = np.zeros((0, 3))
        count = len(positions) if positions.ndim else 0
        set_field(self, 'positions', _field('positions', positions, (count, 3)))
        quaternions = self.quaternions
        if quaternions is None:
            quaternions = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
        set_field(self, 'quaternions', _unit_quaternions(quaternions, (count, 4)))
        for name in ('velocities', 'angular_velocities'):
            value = getattr(self, name)
            value = np.zeros((count, 3)) if value is None else value
            set_field(self, name, _field(name, value, (count, 3)))

    def __len__(self) -> int:
        return len(self.positions)

    @classmethod
    def unchecked(
        cls, positions: Array, quaternions: Array, velocities: Array, angular_velocities: Array
    ) -> State:
        """State of arrays that are known to be valid: neither checked nor copied."""
        state = object.__new__(cls)
        fields = (positions, quaternions, velocities, angular_velocities)
        names = ('positions', 'quaternions', 'velocities', 'angular_velocities')
        for name, value in zip(names, fields, strict=True):
            object.__setattr__(state, name, value)
        return state


def stacked(states: Sequence[State]) -> State:
    """Consecutive states as one, fields of shape (steps, n, k); of no states (0, 0, k)."""
    if not states:
        return State.unchecked(*(np.zeros((0, 0, k)) for k in (3, 4, 3, 3)))
    names = ('positions', 'quaternions', 'velocities', 'angular_velocities')
    return State.unchecked(*(np.stack([getattr(s, name) for s in states]) for name in names))


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """States at equal time steps; index 0 is the start.

    Args:
        positions: Centres [m], shape (steps + 1, n, 3).
        quaternions: Rotations (x, y, z, w), shape (steps + 1, n, 4).
        velocities: Linear velocities [m/s], shape (steps + 1, n, 3).
        angular_velocities: Angular velocities [rad/s], world frame, shape (steps + 1, n, 3).
        dt: Time step [s].

    A rollout that diverged may hold values that are not finite: `diverged_at` tells where.

    Raises:
        UserError: Shapes disagree, or dt is not a positive number.
    """

    positions: Array
    quaternions: Array
    velocities: Array
    angular_velocities: Array
    dt: float

    def __post_init__(self) -> None:
        shape = np.shape(self.positions)
        if len(shape) != 3 or shape[2] != 3 or shape[0] < 1:
            raise UserError(f'positions have shape {shape}, expected (steps + 1, n, 3)')
        for name, last in (
            ('positions', 3),
            ('quaternions', 4),
            ('velocities', 3),
            ('angular_velocities', 3),
        ):
            array = np.asarray(getattr(self, name), dtype=np.float64)
            if array.shape != (*shape[:2], last):
                raise UserError(
                    f'{name} have shape {array.shape}, expected {(*shape[:2], last)} as positions'
                )
            object.__setattr__(self, name, array)
        if not (np.isfinite(self.dt) and self.dt > 0):
            raise UserError(f'dt is {self.dt}, expected a positive number of seconds')
        object.__setattr__(self, 'dt', float(self.dt))

    @classmethod
    def from_states(cls, states: list[State], dt: float) -> Trajectory:
        """Stack states that are `dt` [s] apart."""
        return cls(**vars(stacked(states)), dt=dt)

    @classmethod
    def from_poses(cls, positions: ArrayLike, quaternions: ArrayLike, dt: float) -> Trajectory:
        """Trajectory from poses alone, with velocities by backward differences.

        Thesis section 3.3: v[k] = (p[k] - p[k-1]) / dt and
        w[k] = 2 Im(log(q[k] * inverse(q[k-1]))) / dt. The first frame repeats the second.

        Args:
            positions: Centres [m], shape (steps + 1, n, 3).
            quaternions: Rotations (x, y, z, w), shape (steps + 1, n, 4).
            dt: Time step [s].
        """
        positions = np.asarray(positions, dtype=np.float64)
        quaternions = np.asarray(quaternions, dtype=np.float64)
        velocities = np.zeros_like(positions)
        angular = np.zeros_like(positions)
        if len(positions) > 1:
            velocities[1:] = np.diff(positions, axis=0) / dt
            angular[1:] = rotation_between(quaternions[:-1], quaternions[1:]) / dt
            velocities[0], angular[0] = velocities[1], angular[1]
        return cls(
            positions=positions,
            quaternions=quaternions,
            velocities=velocities,
            angular_velocities=angular,
            dt=dt,
        )

    @property
    def steps(self) -> int:
        """Number of steps, one less than the number of states."""
        return len(self.positions) - 1

    @property
    def count(self) -> int:
        """Number of spheres n."""
        return int(self.positions.shape[1])

    @property
    def times(self) -> Array:
        """Time of each state since the start [s], shape (steps + 1,)."""
        return np.arange(len(self.positions), dtype=np.float64) * self.dt

    @property
    def diverged_at(self) -> int | None:
        """First step with a value that is not finite, or None."""
        bad = ~(
            np.isfinite(self.positions).all((1, 2))
            & np.isfinite(self.velocities).all((1, 2))
            & np.isfinite(self.angular_velocities).all((1, 2))
        )
        return int(np.argmax(bad)) if bad.any() else None

    def __len__(self) -> int:
        return len(self.positions)

    def __iter__(self) -> Iterator[State]:
        return (self[step] for step in range(len(self)))

    def __getitem__(self, step: int) -> State:
        return State(
            positions=self.positions[step],
            quaternions=self.quaternions[step],
            velocities=self.velocities[step],
            angular_velocities=self.angular_velocities[step],
        )

    def window(self, start: int, stop: int) -> Trajectory:
        """Steps `start` to `stop`, without `stop`, as a trajectory of its own."""
        return self._part(slice(start, stop))

    def every(self, count: int) -> Trajectory:
        """The first and each `count`-th state after it, as a trajectory of its own."""
        return replace(self._part(slice(None, None, count)), dt=count * self.dt)

    def _part(self, part: slice) -> Trajectory:
        return replace(
            self,
            positions=self.positions[part],
            quaternions=self.quaternions[part],
            velocities=self.velocities[part],
            angular_velocities=self.angular_velocities[part],
        )


def quaternion_multiply(a: ArrayLike, b: ArrayLike) -> Array:
    """Hamilton product a * b of quaternions (x, y, z, w), shape (..., 4)."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    ax, ay, az, aw = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bx, by, bz, bw = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    x = aw * bx + ax * bw + ay * bz - az * by
    product = np.empty((*np.shape(x), 4))
    product[..., 0] = x
    product[..., 1] = aw * by - ax * bz + ay * bw + az * bx
    product[..., 2] = aw * bz + ax * by - ay * bx + az * bw
    product[..., 3] = aw * bw - ax * bx - ay * by - az * bz
    return product


def rotation_between(before: ArrayLike, after: ArrayLike) -> Array:
    """Rotation vector [rad], world frame, that turns `before` into `after`; shape (..., 3).

    2 Im(log(after * inverse(before))), thesis section 3.3, by the shorter way round, so that q and
    -q count as the same rotation.
    """
    conjugate = np.asarray(before, dtype=np.float64) * [-1.0, -1.0, -1.0, 1.0]
    relative = quaternion_multiply(after, conjugate)
    relative = relative * np.where(relative[..., 3:] < 0, -1.0, 1.0)
    sine = np.linalg.norm(relative[..., :3], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, relative[..., 3:])
    # sin(x/2) / x tends to 1/2: below 1e-12 the ratio is exact in float64
    return np.where(sine > 1e-12, angle / np.maximum(sine, 1e-300), 2.0) * relative[..., :3]


def rotate_quaternions(quaternions: ArrayLike, rotation: ArrayLike) -> Array:
    """Turn `quaternions` (..., 4) by world-frame rotation vectors [rad] (..., 3), exactly."""
    rotation = np.asarray(rotation, dtype=np.float64)
    angle = np.linalg.norm(rotation, axis=-1, keepdims=True)
    half_sinc = 0.5 * np.sinc(angle / (2.0 * np.pi))
    turn = np.concatenate([half_sinc * rotation, np.cos(0.5 * angle)], axis=-1)
    product = quaternion_multiply(turn, quaternions)
    norm: Array = np.linalg.norm(product, axis=-1, keepdims=True)
    return product / norm


def rotation_matrices(quaternions: Array) -> Array:
    """Rotation matrices of quaternions, shape (k, 4), shape (k, 3, 3)."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).transpose(2, 0, 1)
