# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Starts of tracked spheres by the laws of the scene."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Self

from .known_laws import KnownLaws, MOST_BALLS, most_balls, state_by_laws
from .motion_models import Motion
from .pose_noise import rotating
from .stamp_jitter import newest_noise
from .state_estimate import motion_covariance, StateEstimate
from .tracker_settings import TrackerSettings
from .tracks import Tracks
from ..scenes.plane import Plane
from ..scenes.scene import Scene
from ..scenes.state import Array


@dataclass(frozen=True, eq=False)
class SceneLaws:
    """Laws of a scene, by the ids of spheres.

    Args:
        scene: The scene.
        memory: Frames of this time before the newest count [s].
        noise: Standard deviation of a coordinate [m]; None: not learned.
        most: Of more balls, starts are not those of the laws.
    """

    scene: Scene
    memory: float
    noise: float | None
    most: float

    @classmethod
    def of(cls, scene: Scene) -> Self | None:
        """Laws of a scene; None: it has too many balls, see `most_balls`."""
        most = most_balls(scene)
        if (scene.sphere_count or 0) > most:
            return None
        laws = KnownLaws.of(scene, (0,))
        return cls(scene, laws.tracker.memory, laws.tracker.noise if laws.learned else None, most)

    @lru_cache(maxsize=8)  # noqa: B019 of few objects, which live as long as a node
    def _of_ids(self, ids: tuple[int, ...]) -> KnownLaws:
        return KnownLaws.of(self.scene, ids)

    def estimate(
        self, tracks: Tracks, settings: TrackerSettings, carried: tuple[Plane, ...] = ()
    ) -> StateEstimate:
        """State at the newest frame, and its covariance, from all frames in memory.

        `carried` are planes that change place besides those of the scene, as they are then.
        """
        noise = tracks.noise(settings)
        ids = tuple(tracks.ids.tolist())
        laws = self._of_ids(ids)
        if carried:
            laws = laws.among(self.scene, carried, ids)
        times, places = (tracks.stamps - tracks.stamps[-1]) * 1e-9, tracks.poses[..., :3]

        def otherwise() -> tuple[Motion, Array]:
            if laws.learned or len(tracks.ids) > MOST_BALLS:
                return by_window(tracks, settings)
            own = newest_noise(times, places, tracks.seen, noise)
            return by_window(tracks, replace(settings, noise=own))

        state, covariance = state_by_laws(
            laws, times, places, tracks.rotations(), tracks.seen, otherwise, MOST_BALLS, noise
        )
        return StateEstimate(state, covariance)


def by_window(tracks: Tracks, settings: TrackerSettings) -> tuple[Motion, Array]:
    """Motion at the newest frame from the window, and its covariance, shape (n, 9, 9)."""
    motion = tracks.window_motion(settings)
    turned = rotating(tracks.rotations(), tracks.seen)
    radii = settings.environment.radii(tracks.ids)
    return motion, motion_covariance(motion, radii, tracks.noise(settings), turned)
