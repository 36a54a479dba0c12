# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses and velocities of spheres as tensors: from one pose to the next and back (section 3.3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from .rotations import rotate_quaternions, rotation_between


class Motion(NamedTuple):
    """What the thesis' GNS sees of the spheres at t_k, float64; of one scene or a batch.

    Args:
        positions: Centres [m], shape (n, 3).
        quaternions: Rotations (x, y, z, w), shape (n, 4).
        velocities: v[k], v[k-1], ..., v[k-H] by backward differences [m/s], shape (H + 1, n, 3).
        angular_velocities: Likewise [rad/s], shape (H + 1, n, 3).
    """

    positions: Tensor
    quaternions: Tensor
    velocities: Tensor
    angular_velocities: Tensor

    def advanced(self, predicted: Tensor, dt: float) -> Motion:
        """Motion at t_k + dt, from the next [v, omega], shape (n, 6)."""
        velocity, angular = predicted[:, :3], predicted[:, 3:]
        return Motion(
            *integrate(self.positions, self.quaternions, velocity, angular, dt),
            torch.cat([velocity[None], self.velocities[:-1]]),
            torch.cat([angular[None], self.angular_velocities[:-1]]),
        )

    def to(self, device: torch.device) -> Motion:
        """Motion on another device."""
        return Motion(*(values.to(device) for values in self))


def joined(motions: Sequence[Motion]) -> Motion:
    """Motions of several scenes as one, with the spheres in the order of the scenes."""
    return Motion(
        torch.cat([motion.positions for motion in motions]),
        torch.cat([motion.quaternions for motion in motions]),
        torch.cat([motion.velocities for motion in motions], dim=1),
        torch.cat([motion.angular_velocities for motion in motions], dim=1),
    )


def integrate(
    positions: Tensor,
    quaternions: Tensor,
    velocities: Tensor,
    angular_velocities: Tensor,
    dt: float,
) -> tuple[Tensor, Tensor]:
    """Semi-implicit Euler: p + v dt, and q turned by w dt; inverse of `difference`.

    The rotation is the exponential of w dt in the world frame. The thesis' first order form,
    q + q (0, w) dt / 2 and normalised, turns a sphere that rolls at 20 m/s by 90 degrees in a step
    of 0.1 s, where it should be 115.

    Args:
        positions: Centres [m], shape (n, 3).
        quaternions: Rotations (x, y, z, w), shape (n, 4).
        velocities: [m/s], shape (n, 3).
        angular_velocities: [rad/s], world frame, shape (n, 3).
        dt: Length of the step [s].
    """
    return positions + dt * velocities, rotate_quaternions(quaternions, dt * angular_velocities)


def difference(
    positions: Tensor,
    quaternions: Tensor,
    next_positions: Tensor,
    next_quaternions: Tensor,
    dt: float,
) -> tuple[Tensor, Tensor]:
    """Velocities [m/s] and angular velocities [rad/s] that lead to the next pose (section 3.3).

    Positions have shape (n, 3), quaternions (n, 4), both results (n, 3).
    """
    return (next_positions - positions) / dt, rotation_between(quaternions, next_quaternions) / dt
