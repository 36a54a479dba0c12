# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start of a forecast: its tracked frames and the reason, as published on ~/start.

A forecast depends on these frames, their noise, the scene and the model alone, and a prediction on
its forecast and its stamp. So recorded frames and starts reproduce every recorded prediction;
a start holds the surfaces that bodies carry. Where poses are matched, the ids depend on all frames
accepted since the last start whose reason is first, reset, restart or learned.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
import json
from typing import Literal

from .moving_surfaces import surfaces_from_mapping, surfaces_to_mapping
from ..errors import shown, UserError
from ..files.strict_json import parse_json
from ..scenes.plane import Plane

Reason = Literal['first', 'every', 'diverged', 'reset', 'restart', 'spheres', 'learned']


@dataclass(frozen=True)
class Start:
    """The start of a forecast.

    Args:
        stamp_ns: Stamp of the start frame [ns].
        window_ns: Stamps of the frames from which velocities are estimated, the start frame last
            [ns].
        reason: first: the node's first; every: a newer frame, with `start: every`; diverged: the
            error exceeded its bound; reset: after ~/reset; restart: tracker or clock restarted,
            the node was paused, or a forecast failed; spheres: the set of spheres changed;
            learned: a learned scene took the place of the one before.
        ids: Id of each sphere, in the order of predicted poses; None: not recorded.
        noise: Standard deviation of each coordinate of a tracked position [m]; None: not recorded.
        index: Index in the order of recording, over all topics; -1: not recorded.
        surfaces: Surfaces that bodies carry, at the stamp, by index in the scene.
    """

    stamp_ns: int
    window_ns: tuple[int, ...]
    reason: str
    ids: tuple[int, ...] | None = None
    noise: float | None = None
    index: int = -1
    surfaces: Mapping[int, Plane] = field(default_factory=dict)

    @property
    def json(self) -> str:
        """Text of the message on ~/start."""
        content = {one.name: getattr(self, one.name) for one in fields(self)}
        del content['index']
        content['surfaces'] = surfaces_to_mapping(self.surfaces) or None
        return json.dumps({name: value for name, value in content.items() if value is not None})

    @classmethod
    def from_json(cls, text: str, index: int = -1) -> Start:
        """Parse the text of a message on ~/start.

        Raises:
            UserError: The text is not such a start.
        """
        try:
            content = parse_json(text)
            return cls(
                int(content['stamp_ns']),
                tuple(int(stamp) for stamp in content['window_ns']),
                str(content.get('reason', '')),
                tuple(int(one) for one in content['ids']) if 'ids' in content else None,
                float(content['noise']) if 'noise' in content else None,
                index,
                surfaces_from_mapping(content.get('surfaces', {})),
            )
        except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
            raise UserError(
                f'{shown(error)}; expected JSON with stamp_ns, window_ns and reason'
            ) from error
