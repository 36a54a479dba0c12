# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fits without a part of the tracks each: standard errors, and scenes to which tracks are new."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from .joint_fit import Fitted
from .ladder import fit_setup, Setup
from .parameters import Laws
from .stretches import Stretch
from ..data.tracks import Track
from ..running.threads import in_threads, usable_cores
from ..scenes.scene import Scene
from ..tracking.start_prior import StartPrior


@dataclass(frozen=True)
class LeftOut:
    """What is learned without some tracks, which are new to it.

    Args:
        scene: The scene.
        tracks: The tracks; of few recordings their pieces between unknown contacts.
    """

    scene: Scene
    tracks: tuple[Track, ...]


def groups_of(numbers: Sequence[int], count: int, together: bool) -> list[set[int]]:
    """Tracks in groups: every so many-th one, or those that follow each other."""
    if together:
        return [set(part.tolist()) for part in np.array_split(np.array(numbers), count)]
    return [set(numbers[k::count]) for k in range(count)]


def fits_without(
    laws: Laws,
    setup: Setup,
    found: Sequence[Stretch],
    fitted: Fitted,
    groups: Sequence[Collection[int]],
) -> list[tuple[dict[str, float], StartPrior | None]]:
    """Values and spins by fits without a group of tracks each."""

    def without(out: Collection[int]) -> tuple[dict[str, float], StartPrior | None]:
        kept = np.array([one.track not in out for one in found])
        before = Fitted(
            fitted.values,
            fitted.starts[kept],
            fitted.losses[kept],
            fitted.impacts[kept],
            fitted.spin_covariances[kept],
        )
        part = [one for one, stays in zip(found, kept, strict=True) if stays]
        one, prior, _ = fit_setup(laws, setup, part, before)
        return one.values, prior

    return in_threads(without, groups, usable_cores())


def jackknife_errors(
    setup: Setup, fitted: Fitted, parts: Sequence[dict[str, float]]
) -> dict[str, float]:
    """Standard errors, the larger of the scores' and of a jackknife of groups of tracks."""
    if not setup.names:
        return {}
    values = [[own[name] for name in setup.names] for own in parts]
    spread = np.std(values, axis=0) * np.sqrt(len(parts) - 1)
    return {name: max(fitted.errors[name], float(spread[k])) for k, name in enumerate(setup.names)}
