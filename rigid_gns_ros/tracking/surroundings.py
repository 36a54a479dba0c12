"""What spheres of a scene can touch, and where a flight meets it. Surfaces only, no ROS."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid_gns_core.scene import Scene
from rigid_gns_core.state import Array


class Contacts(NamedTuple):
    """Where flights first meet a surface; `...` stands for the shape of the flights.

    Args:
        times: Of the contact [s], NaN where there is none, shape (...).
        normals: Of the surface, shape (..., 3).
        restitution: Of the pair, shape (...).
        friction: Of the pair, shape (...).
    """

    times: Array
    normals: Array
    restitution: Array
    friction: Array


@dataclass(frozen=True)
class Surroundings:
    """Surfaces, gravity and radii.

    Args:
        gravity: Acceleration of free flight [m/s^2], shape (3,).
        radius: Of the spheres [m]: one for all, or one per sphere id.
        points: A point of each surface [m], shape (k, 3).
        axes: Direction, the other direction and normal of each surface, shape (k, 3, 3).
        halves: Half lengths along the two directions [m], shape (k, 2).
        restitution: Of a sphere on each surface, shape (k,).
        friction: Of a sphere on each surface, shape (k,).
        rolling_friction: Of a sphere.
        bounce: Restitution of two spheres.
        known: Whether the surfaces are known; without, spheres may be carried anywhere.
    """

    gravity: Array
    radius: Array
    points: Array
    axes: Array
    halves: Array
    restitution: Array
    friction: Array
    rolling_friction: float = 0.0
    bounce: float = 1.0
    known: bool = True

    @classmethod
    def of(cls, scene: Scene) -> Surroundings:
        """Those of a scene; materials that differ between spheres enter with their mean."""
        surfaces = scene.surfaces
        return cls(
            gravity=np.asarray(scene.gravity, dtype=np.float64),
            radius=np.asarray(scene.radius, dtype=np.float64),
            points=np.array([plane.point for plane in surfaces]).reshape(-1, 3),
            axes=np.array([plane.axes for plane in surfaces]).reshape(-1, 3, 3),
            halves=np.array([(p.length_x / 2, p.length_y / 2) for p in surfaces]).reshape(-1, 2),
            restitution=scene.surface_values('restitution') * float(np.mean(scene.restitution)),
            friction=scene.surface_values('friction') * float(np.mean(scene.friction)),
            rolling_friction=float(np.mean(scene.rolling_friction)),
            bounce=float(np.mean(scene.restitution)) ** 2,
        )

    @classmethod
    def unknown(cls, gravity: ArrayLike, radius: float) -> Surroundings:
        """Gravity alone, where no scene is given."""
        none = np.zeros((0, 3))
        return cls(
            gravity=np.asarray(gravity, dtype=np.float64),
            radius=np.asarray(radius, dtype=np.float64),
            points=none,
            axes=np.zeros((0, 3, 3)),
            halves=np.zeros((0, 2)),
            restitution=np.zeros(0),
            friction=np.zeros(0),
            known=False,
        )

    def radii(self, ids: NDArray[np.int64]) -> Array:
        """Radius of each sphere [m]; one that the scene does not know has the largest."""
        if self.radius.ndim == 0:
            return np.full(len(ids), float(self.radius))
        known = (ids >= 0) & (ids < len(self.radius))
        return np.where(
            known, self.radius[np.clip(ids, 0, len(self.radius) - 1)], self.radius.max()
        )

    def gaps(self, positions: Array, radii: Array) -> Array:
        """Distance of spheres from each surface [m], infinite beside it, shape (..., n, k)."""
        offsets = positions[..., None, :] - self.points
        local = np.einsum('...kc,kdc->...kd', offsets, self.axes)
        inside = (np.abs(local[..., :2]) <= self.halves).all(axis=-1)
        return np.where(inside, local[..., 2] - radii[..., None], np.inf)

    def nearest(self, positions: Array, radii: Array) -> tuple[NDArray[np.int64], Array]:
        """The surface nearest to each sphere, and its distance [m]; infinite without surfaces."""
        if not len(self.points):
            return np.zeros(len(positions), dtype=np.int64), np.full(len(positions), np.inf)
        gaps = np.abs(self.gaps(positions, radii))
        index = gaps.argmin(axis=-1)
        return index, np.take_along_axis(gaps, index[:, None], axis=-1)[:, 0]

    def first_contact(
        self, places: Array, speeds: Array, radii: Array, begin: Array, end: Array
    ) -> Contacts:
        """First descent on to a surface of p(t) = places + speeds t + g t^2 / 2.

        Args:
            places: Centres at time 0 [m], shape (..., 3).
            speeds: Velocities at time 0 [m/s], shape (..., 3).
            radii: [m], shape that fits (...).
            begin: Earliest time [s], shape that fits (...).
            end: Latest time [s].
        """
        shape = places.shape[:-1]
        times, index = np.full(shape, np.inf), np.zeros(shape, dtype=np.int64)
        for k, (point, axes, half) in enumerate(
            zip(self.points, self.axes, self.halves, strict=True)
        ):
            a = 0.5 * float(axes[2] @ self.gravity)
            b = speeds @ axes[2]
            c = (places - point) @ axes[2] - radii
            with np.errstate(divide='ignore', invalid='ignore'):
                root = np.sqrt(b**2 - 4.0 * a * c)
                # the same root, each form where its terms do not cancel
                when = np.where(b > 0, (-b - root) / (2.0 * a), 2.0 * c / (root - b))
                hit = (when >= begin) & (when <= end) & (root > 0)
            when = np.where(hit, when, np.inf)
            at = np.where(hit, when, 0.0)[..., None]
            local = (places + speeds * at + 0.5 * self.gravity * at**2 - point) @ axes[:2].T
            hit &= (np.abs(local) <= half).all(axis=-1) & (when < times)
            times, index = np.where(hit, when, times), np.where(hit, k, index)
        none = ~np.isfinite(times)
        if not len(self.points):
            zero = np.zeros(shape)
            return Contacts(np.full(shape, np.nan), np.zeros((*shape, 3)), zero, zero)
        return Contacts(
            np.where(none, np.nan, times),
            self.axes[index, 2],
            self.restitution[index],
            self.friction[index],
        )


def after_impact(
    speeds: Array, spins: Array, contacts: Contacts, radii: Array
) -> tuple[Array, Array]:
    """Velocity and spin of solid spheres after an impact, by restitution and Coulomb friction."""
    normals, zero = contacts.normals, np.zeros(())
    into = np.minimum((speeds * normals).sum(axis=-1), zero)
    slip = speeds - (speeds * normals).sum(axis=-1, keepdims=True) * normals
    slip = slip - radii[..., None] * np.cross(spins, normals)
    size = np.linalg.norm(slip, axis=-1)
    # 2/7 of the slip stops it; friction may not reach that far
    part = np.minimum(
        2.0 / 7.0,
        -contacts.friction * (1.0 + contacts.restitution) * into / np.maximum(size, 1e-300),
    )
    push = -part[..., None] * slip
    after = speeds - ((1.0 + contacts.restitution) * into)[..., None] * normals + push
    return after, spins - 2.5 / radii[..., None] * np.cross(normals, push)
