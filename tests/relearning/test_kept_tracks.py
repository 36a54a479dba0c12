# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracks that a running node keeps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rigid_gns_core import Scene
from rigid_gns_core.relearning.kept_tracks import KeptTracks, MOST_BALLS

FRAME = 10_000_000  # [ns]
SCENE = Scene(radius=0.02)


def send(kept: KeptTracks, begin: int, count: int, ids: tuple[int, ...] = (0,)) -> None:
    for k in range(count):
        centres = np.full((len(ids), 3), 0.001 * k)
        kept.take(begin + k * FRAME, ids, centres)


def test_tracks_end_at_gaps_and_where_spheres_change() -> None:
    kept = KeptTracks(SCENE)
    send(kept, 0, 20)
    assert kept.finished == 0 and not kept.ends(20 * FRAME)
    assert kept.ends(19 * FRAME + 260_000_000)
    send(kept, 1_000_000_000, 12)
    send(kept, 1_000_000_000 + 12 * FRAME, 9, ids=(0, 4))
    kept.cut()
    assert kept.finished == 3
    assert [len(track.times) for track in kept.tracks] == [20, 12, 9]
    assert [track.spheres for track in kept.tracks] == [('0',), ('0',), ('0', '1')]
    first = kept.tracks[0]
    np.testing.assert_allclose(np.diff(first.times), 0.01)
    np.testing.assert_allclose(first.positions[:, 0, 0], 0.001 * np.arange(20))


def test_labels_are_ids_where_spheres_differ() -> None:
    kept = KeptTracks(replace(SCENE, mass=(1.0, 2.0, 3.0)))
    send(kept, 0, 10, ids=(1, 2))
    kept.cut()
    assert kept.tracks[0].spheres == ('1', '2')


def test_memory_is_bounded() -> None:
    kept = KeptTracks(SCENE, most=3)
    for k in range(5):
        send(kept, k * 1_000_000_000, 10)
    send(kept, 10_000_000_000, 2500)  # without a gap for 25 s
    kept.cut()
    assert [track.name for track in kept.tracks] == ['5', '6', '7']
    assert kept.tracks[-2].times[-1] <= 10.0


def test_what_tells_nothing_is_left_out() -> None:
    kept = KeptTracks(SCENE)
    send(kept, 0, 7)  # too short
    send(kept, 1_000_000_000, 20, ids=tuple(range(MOST_BALLS + 1)))
    kept.cut()
    assert kept.finished == 0


def test_late_frames_are_left_out_and_a_clock_that_was_set_back_is_followed() -> None:
    kept = KeptTracks(SCENE)
    send(kept, 100_000_000_000, 10)
    kept.take(100_000_000_000, (0,), np.ones((1, 3)))
    send(kept, 0, 10)
    kept.cut()
    assert [len(track.times) for track in kept.tracks] == [10, 10]
