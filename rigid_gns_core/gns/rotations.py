# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rotations of tensors, with gradients; `scenes.state` has the same for arrays."""

from __future__ import annotations

import math

import torch
from torch import Tensor


def quaternion_multiply(a: Tensor, b: Tensor) -> Tensor:
    """Hamilton product a * b of quaternions (x, y, z, w), shape (..., 4)."""
    ax, ay, az, aw = a.unbind(-1)
    bx, by, bz, bw = b.unbind(-1)
    return torch.stack(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ],
        dim=-1,
    )


def rotate_quaternions(quaternions: Tensor, rotation: Tensor) -> Tensor:
    """Turn `quaternions` (..., 4) by world-frame rotation vectors [rad] (..., 3), exactly."""
    angle = torch.linalg.vector_norm(rotation, dim=-1, keepdim=True)  # gradient 0 at 0, not NaN
    half_sinc = 0.5 * torch.sinc(angle / (2.0 * math.pi))
    turn = torch.cat([half_sinc * rotation, torch.cos(0.5 * angle)], dim=-1)
    product = quaternion_multiply(turn, quaternions)
    norm: Tensor = torch.linalg.vector_norm(product, dim=-1, keepdim=True)
    return product / norm


def rotation_between(before: Tensor, after: Tensor) -> Tensor:
    """Rotation vector [rad], world frame, that turns `before` into `after`; shape (..., 3)."""
    conjugate = before * before.new_tensor([-1.0, -1.0, -1.0, 1.0])
    relative = quaternion_multiply(after, conjugate)
    relative = torch.where(relative[..., 3:] < 0, -relative, relative)
    sine = torch.linalg.vector_norm(relative[..., :3], dim=-1, keepdim=True)
    angle = 2.0 * torch.atan2(sine, relative[..., 3:])
    # sin(x/2) / x tends to 1/2: below 1e-12 the ratio is exact in float64
    ratio = torch.where(sine > 1e-12, angle / sine.clamp(min=1e-12), 2.0)
    return ratio * relative[..., :3]
