# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether the poses of a bag are in the units and axes of its scene, told by what falls."""

from __future__ import annotations

from collections.abc import Sequence

from ..decoded_topic import DecodedTopic
from ..importing.units_and_axes import check_fall
from ..tracked_frames import as_track, Segment, segment_frames
from ...scenes.scene import Scene
from ...tracking.usable_frames import GAP, median_interval

_REMEDY = 'publish metres with z up, or import the bag and evaluate the data: rigid-gns import'


def check_units(segments: Sequence[Segment], scene: Scene, noise: float, where: str) -> None:
    """Compare free fall with gravity of the scene, see `check_fall`.

    Raises:
        UserError: Spheres fall with another acceleration, or along another axis.
    """
    tracks = [as_track(part, str(index)) for index, part in enumerate(segments)]
    check_fall(tracks, scene, noise, where, _REMEDY)


def check_topic_units(tracked: DecodedTopic, scene: Scene, where: str) -> None:
    """As `check_units`, of all frames of a topic; poses in no fixed order show no fall."""
    gap = GAP * median_interval(tracked.stamps)
    parts = segment_frames(tracked, scene, gap)
    check_units(parts.segments, scene, parts.noise().position, where)
