# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the process that learns is told, as bytes: tracks and two scenes, to the bit."""

from __future__ import annotations

from collections.abc import Sequence
import io
import json
from typing import Any

import numpy as np

from ..data.tracks import Track
from ..scenes.scene import Scene


def encode_task(tracks: Sequence[Track], given: Scene, present: Scene) -> bytes:
    """Arguments of `relearn` as bytes; of a track its name, times, positions and labels."""
    head = {
        'tracks': [[track.name, list(track.spheres)] for track in tracks],
        'scenes': [given.to_mapping(), present.to_mapping()],
    }
    arrays: dict[str, Any] = {'head': np.array(json.dumps(head))}
    for k, track in enumerate(tracks):
        arrays |= {f'times_{k}': track.times, f'positions_{k}': track.positions}
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def decode_task(content: bytes) -> tuple[list[Track], Scene, Scene]:
    """Inverse of `encode_task`."""
    arrays = np.load(io.BytesIO(content))
    head = json.loads(str(arrays['head']))
    tracks = [
        Track(name, arrays[f'times_{k}'], arrays[f'positions_{k}'], None, tuple(spheres))
        for k, (name, spheres) in enumerate(head['tracks'])
    ]
    given, present = (Scene.from_mapping(scene) for scene in head['scenes'])
    return tracks, given, present
