"""Velocities from tracked poses, by least squares.

Between contacts a sphere obeys p(t) = p0 + v t + g t^2 / 2 and turns at a constant rate w, so with
t counted from the last frame v and w are slopes of straight lines. Stamps may be unevenly spaced.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rigid_gns_core.state import Array, rotation_between


def estimate_velocities(
    times: ArrayLike, positions: ArrayLike, quaternions: ArrayLike, gravity: ArrayLike
) -> tuple[Array, Array]:
    """Velocities at the last of a few frames.

    Noise of standard deviation s in each position gives s / sqrt(sum((t - mean(t))^2)) in each
    component of v. One frame alone means at rest. A sphere that a surface carries does not fall,
    which shows from three frames on: where uniform motion fits better than free flight, it is used.
    Contacts inside the window bias the estimate of the spheres that have them.

    Args:
        times: Increasing times of the frames [s], shape (frames,).
        positions: Centres [m], shape (frames, n, 3).
        quaternions: Rotations (x, y, z, w), shape (frames, n, 4); between two frames a sphere may
            turn by less than half a turn.
        gravity: Acceleration of free flight [m/s^2], shape (3,).

    Returns:
        Velocities [m/s] and angular velocities [rad/s], world frame, each of shape (n, 3).
    """
    stamps: Array = np.asarray(times, dtype=np.float64)
    places: Array = np.asarray(positions, dtype=np.float64)
    turns: Array = np.asarray(quaternions, dtype=np.float64)
    if len(stamps) == 0 or len(stamps) != len(places) or len(stamps) != len(turns):
        raise ValueError(
            f'{len(stamps)} times, {len(places)} frames of positions and {len(turns)} of '
            'quaternions; expected one of each per frame, and at least one frame'
        )
    if len(stamps) == 1:
        return np.zeros(places.shape[1:]), np.zeros(places.shape[1:])
    if not (np.diff(stamps) > 0).all():
        raise ValueError(f'times are {stamps.tolist()} s, expected increasing ones')
    stamps = stamps - stamps[-1]
    fall: Array = 0.5 * stamps[:, None, None] ** 2 * np.asarray(gravity, dtype=np.float64)
    velocities, misfit = _slope(stamps, places - fall)
    if len(stamps) > 2:  # two frames fit either motion exactly
        uniform, uniform_misfit = _slope(stamps, places)
        velocities = np.where((uniform_misfit < misfit)[:, None], uniform, velocities)
    # summed increments: the total may pass half a turn, and to first order their noise telescopes
    turned = np.zeros_like(places)
    turned[1:] = np.cumsum(rotation_between(turns[:-1], turns[1:]), axis=0)
    angular_velocities, _ = _slope(stamps, turned)
    return velocities, angular_velocities


def _slope(times: Array, values: Array) -> tuple[Array, Array]:
    """Slope of the least-squares line of each component, and the squared misfit of each sphere.

    Args:
        times: shape (frames,).
        values: shape (frames, n, 3).

    Returns:
        Slopes, shape (n, 3), and sums of squared residuals, shape (n,).
    """
    centred = (times - times.mean())[:, None, None]
    offsets = values - values.mean(axis=0)
    slope = (centred * offsets).sum(axis=0) / (centred**2).sum()
    return slope, ((offsets - centred * slope) ** 2).sum(axis=(0, 2))
