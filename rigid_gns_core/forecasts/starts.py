# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""From which tracked frames a forecast started, and why: what ~/start says.

A forecast depends on these frames, their noise, the scene and the model alone, and a prediction on
its forecast and its stamp, so that recorded frames and starts give every recorded prediction
again. Where poses are matched to spheres, who is who depends on all frames accepted since the last
start whose reason is first, reset or restart.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
import json
from typing import Literal

from ..errors import UserError

Reason = Literal['first', 'every', 'diverged', 'reset', 'restart', 'spheres']


@dataclass(frozen=True)
class Start:
    """The start of a forecast.

    Args:
        stamp_ns: Stamp of the frame it starts from [ns].
        window_ns: Stamps of the frames that its velocities come from, that frame last [ns].
        reason: first: the node's first; every: a newer frame, with `start: every`; diverged: the
            error passed its bound; reset: after ~/reset; restart: tracker or clock began anew, the
            node was paused, or a forecast failed; spheres: the set of spheres changed.
        ids: Id of each sphere, in the order of predicted poses; None: not recorded.
        noise: Of each coordinate of a tracked position, as given or estimated so far [m]; None:
            not recorded.
        place: Where it stands in a recording, of which predictions after it are its own.
    """

    stamp_ns: int
    window_ns: tuple[int, ...]
    reason: str
    ids: tuple[int, ...] | None = None
    noise: float | None = None
    place: int = -1

    @property
    def json(self) -> str:
        """As ~/start publishes it."""
        content = asdict(self)
        del content['place']
        return json.dumps({name: value for name, value in content.items() if value is not None})

    @classmethod
    def from_json(cls, text: str, place: int = -1) -> Start:
        """Read what ~/start has published.

        Raises:
            UserError: It is something else.
        """
        try:
            content = json.loads(text)
            return cls(
                int(content['stamp_ns']),
                tuple(int(stamp) for stamp in content['window_ns']),
                str(content.get('reason', '')),
                tuple(int(one) for one in content['ids']) if 'ids' in content else None,
                float(content['noise']) if 'noise' in content else None,
                place,
            )
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise UserError(
                f'{error!r}; expected JSON with stamp_ns, window_ns and reason'
            ) from error
