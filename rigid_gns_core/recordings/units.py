# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether recorded poses are in the units and axes of their scene; where not, an error."""

from __future__ import annotations

from collections.abc import Sequence

from .decoded_topic import DecodedTopic
from .tracked_frames import as_track, Segment, segment_frames
from ..data.free_fall import Misfit, misfit_of_fall, misfit_of_speed, motions_of, speeds_of
from ..data.tracks import Track
from ..errors import UserError
from ..scenes.scene import Scene
from ..tracking.usable_frames import GAP, median_interval

_EVALUATED = 'publish metres with z up, or import the bag and evaluate the data: rigid-gns import'


def check_fall(
    tracks: Sequence[Track], scene: Scene, noise: float, where: str, remedy: str = 'give'
) -> None:
    """Compare free fall with gravity of the scene.

    Args:
        tracks: Tracks of one file, in metres and with z up as far as is known.
        scene: Gives gravity and radius.
        noise: Standard deviation of each coordinate.
        where: Begins the message.
        remedy: What comes before the options in the message.

    Raises:
        UserError: Balls fall with another acceleration, or along another axis; the message names
            the options that repair it.
    """
    _refuse(misfit_of_fall(motions_of(tracks, noise), scene), where, f'; {remedy}')


def check_speed(tracks: Sequence[Track], scene: Scene, where: str) -> None:
    """Compare speeds with those of balls.

    Raises:
        UserError: They are larger; the message names the option that repairs it.
    """
    _refuse(misfit_of_speed(speeds_of(tracks), scene), where, ' then give')


def check_units(segments: Sequence[Segment], scene: Scene, noise: float, where: str) -> None:
    """As `check_fall`, of a bag that is evaluated."""
    tracks = [as_track(part, str(index)) for index, part in enumerate(segments)]
    check_fall(tracks, scene, noise, where, _EVALUATED)


def check_topic_units(tracked: DecodedTopic, scene: Scene, where: str) -> None:
    """As `check_units`, of all frames of a topic; poses in no fixed order show no fall."""
    gap = GAP * median_interval(tracked.stamps)
    parts = segment_frames(tracked, scene, gap)
    check_units(parts.segments, scene, parts.noise().position, where)


def _refuse(misfit: Misfit | None, where: str, remedy: str) -> None:
    if misfit is not None:
        turn = f'{remedy} {misfit.option}' if misfit.option else f'; {misfit.advice}'
        raise UserError(f'{where}: {misfit.text}{turn}')
