"""Where spheres are a little later, unseen: flight or rolling, with at most one contact each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rigid_gns_core.state import Array

from .collisions import exchange, meeting, pairs_near
from .surroundings import Contacts, Surroundings, after_impact

# a contact may lie so many spans of the time back
_BEHIND = 0.5


def coast(
    around: Surroundings,
    places: Array,
    speeds: Array,
    falls: NDArray[np.bool_],
    radii: Array,
    time: Array,
) -> tuple[Array, Array]:
    """Positions [m] and velocities [m/s] after a while, each of shape (n, 3).

    Two spheres that meet exchange their momentum: carried on as if nothing had happened, each would
    be sought where the other is.

    Args:
        around: Gravity, and what spheres bounce off.
        places: Centres [m], shape (n, 3).
        speeds: [m/s], shape (n, 3).
        falls: Whether a sphere flies, rather than being carried, shape (n,).
        radii: [m], shape (n,).
        time: How long [s], shape (n,).
    """
    g = falls[:, None] * around.gravity
    # noise may have put a sphere behind what it is about to meet
    hits = around.first_contact(places, speeds, radii, -_BEHIND * time, time)
    when = np.where(
        falls & (time > 0) & np.isfinite(hits.times), np.maximum(hits.times, 0.0), np.inf
    )
    change = np.zeros_like(speeds)
    hit = np.flatnonzero(np.isfinite(when))
    if len(hit):
        incoming = speeds[hit] + around.gravity * when[hit, None]
        contact = Contacts(*(field[hit] for field in hits))
        change[hit] = after_impact(incoming, np.zeros_like(incoming), contact, radii[hit])[0]
        change[hit] -= incoming
    i, j, met = _meetings(around, places, speeds, g, radii, time)
    if len(i):
        first = when.copy()
        np.minimum.at(first, i, met)
        np.minimum.at(first, j, met)
        both = (met <= first[i]) & (met <= first[j])
        i, j, at = i[both], j[both], met[both, None]
        push = exchange(
            places[j] - places[i] + (speeds[j] - speeds[i]) * at,
            speeds[j] - speeds[i],
            around.bounce,
        )
        change[i], change[j], when[i], when[j] = push, -push, at[:, 0], at[:, 0]
    t = time[:, None]
    rest = np.where(np.isfinite(when), time - when, 0.0)[:, None]
    found = places + speeds * t + 0.5 * g * t**2 + change * rest
    later = speeds + g * t + change
    if len(hit):  # a second bounce would follow: it is held on the surface
        at = when[hit, None]
        place = places[hit] + speeds[hit] * at + 0.5 * g[hit] * at**2
        height = ((found[hit] - place) * hits.normals[hit]).sum(axis=-1)
        struck = when[hit] == np.maximum(hits.times[hit], 0.0)
        found[hit] -= np.where(struck, np.minimum(height, 0.0), 0.0)[:, None] * hits.normals[hit]
    return found, later


def _meetings(
    around: Surroundings, places: Array, speeds: Array, g: Array, radii: Array, time: Array
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Pairs that meet, and when [s]."""
    none = np.zeros(0, dtype=np.int64)
    if not around.known:
        return none, none, np.zeros(0)
    travel = (np.linalg.norm(speeds, axis=1) + np.linalg.norm(g, axis=1) * time) * time
    i, j = pairs_near(places, radii + travel)
    if not len(i):
        return none, none, np.zeros(0)
    met = meeting(places[j] - places[i], speeds[j] - speeds[i], radii[i] + radii[j])
    span = np.minimum(time[i], time[j])
    good = (span > 0) & (met >= -_BEHIND * span) & (met <= span)
    return i[good], j[good], np.maximum(met[good], 0.0)
