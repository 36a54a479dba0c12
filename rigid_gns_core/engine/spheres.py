"""Moving state of all spheres."""

from __future__ import annotations

from typing import NamedTuple

from ..state import Array
from .jit import compiled


class Spheres(NamedTuple):
    """Moving state of all spheres: shapes (n, 3), quaternions (x, y, z, w) (n, 4)."""

    positions: Array
    quaternions: Array
    velocities: Array
    angular_velocities: Array


@compiled
def copy_spheres(spheres: Spheres) -> Spheres:
    """The same in other memory."""
    return Spheres(
        spheres.positions.copy(),
        spheres.quaternions.copy(),
        spheres.velocities.copy(),
        spheres.angular_velocities.copy(),
    )
