# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps of arrival on the clock of the camera."""

from __future__ import annotations

import os
from pathlib import Path

from csv_balls import RATE, shots
import numpy as np
import pytest
from rigid_gns_core.data.csv_tracks import read_csv_tracks
from rigid_gns_core.data.tracks import Track
from rigid_gns_core.recordings.importing.camera_clock import on_camera_clock

JITTER, NOISE = 0.6e-3, 0.7e-3


def seen(
    *, jitter: float, lost: float = 0.0, late: float = 0.0, seed: int = 1
) -> tuple[list[Track], list[np.ndarray]]:
    """Tracks with stamps of arrival, and the true times of their frames."""
    rng = np.random.default_rng(seed)
    tracks, truth = [], []
    for number, (times, centres) in enumerate(shots(12, noise=NOISE)):
        kept = rng.random(len(times)) >= lost
        true = times[kept]
        stamps = true + rng.normal(0.0, jitter, len(true))
        # a frame that is held up holds up those behind it: none overtakes another
        stamps += np.where(rng.random(len(true)) < late, 3.0 / RATE, 0.0)
        stamps = np.maximum.accumulate(stamps) + 1e-9 * np.arange(len(true))
        tracks.append(
            Track(str(number), stamps - stamps[0], centres[kept, None], None, ('0',), stamps[0])
        )
        truth.append(true)
    return tracks, truth


def errors(tracks: list[Track], truth: list[np.ndarray]) -> np.ndarray:
    """Times less the true ones, but for an offset that all tracks have in common [s]."""
    off = [track.times + track.begin - true for track, true in zip(tracks, truth, strict=True)]
    return np.concatenate(off) - np.median(np.concatenate(off))


@pytest.mark.parametrize(('lost', 'late'), [(0.0, 0.0), (0.3, 0.0), (0.0, 0.02), (0.2, 0.02)])
def test_jitter_goes(lost: float, late: float) -> None:
    tracks, truth = seen(jitter=JITTER, lost=lost, late=late)
    found, clock = on_camera_clock(tracks)
    assert clock is not None and clock.used
    assert clock.period == pytest.approx(1 / RATE, rel=2e-4)
    # t0 of a track of 126 frames and more is known to 0.6 ms / sqrt(126) = 0.05 ms, its slope
    # through that of all tracks better. A frame on the wrong tick is 5.6 ms off: none is, but
    # where frames are held up at the end of a track, or one of them is lost besides, which of 2 %
    # held up and 20 % lost are about 2 % of all
    off = np.abs(errors(found, truth))
    assert np.quantile(off, 0.97 if late else 1.0) < 5 * JITTER / np.sqrt(126)
    assert 0.8 * JITTER < clock.jitter < 1.2 * JITTER


def test_exact_stamps_are_kept() -> None:
    tracks, _ = seen(jitter=0.0)
    found, clock = on_camera_clock(tracks)
    assert clock is None and found == tracks


def test_true_stamps_of_an_irregular_camera_are_kept() -> None:
    """The camera itself is irregular, and says when: the motion fits the stamps, not a clock."""
    rng = np.random.default_rng(0)
    tracks = []
    for number in range(12):
        times = np.arange(150) / RATE + rng.normal(0.0, JITTER, 150)
        places = np.stack([4.0 * times, 0.0 * times, times - 4.905 * times**2], axis=1)
        places += rng.normal(0.0, NOISE, places.shape)
        tracks.append(Track(str(number), times - times[0], places[:, None], None, ('0',)))
    found, clock = on_camera_clock(tracks)
    assert found == tracks
    assert clock is not None and not clock.used and clock.gain < 1.0
    assert 'stamps are kept' in str(clock)


def test_stamps_without_a_clock_are_kept() -> None:
    rng = np.random.default_rng(0)
    times = np.cumsum(rng.uniform(0.5, 1.5, 300) / RATE)
    track = Track('0', times - times[0], np.zeros((300, 1, 3)), None, ('0',))
    assert on_camera_clock([track]) == ([track], None)


def test_a_track_of_few_frames_stays_as_it_is() -> None:
    tracks, _ = seen(jitter=JITTER)
    short = Track('s', np.array([0.0, 0.006]), np.zeros((2, 1, 3)), None, ('0',))
    found, _ = on_camera_clock([short, *tracks])
    assert found[0] == short and on_camera_clock([short]) == ([short], None)


@pytest.mark.parametrize('name', ['tt_gun', 'tt_robot'])
def test_recorded_times_of_arrival(tmp_path: Path, name: str) -> None:
    """A recording whose times of arrival and of the camera are both known."""
    folder = Path(os.environ.get('RIGID_GNS_RECORDINGS', tmp_path))
    if not (folder / f'{name}.csv').is_file():
        pytest.skip('RIGID_GNS_RECORDINGS names no folder of recordings')
    text = (folder / f'{name}.csv').read_text()
    arrived = tmp_path / 'arrived.csv'
    arrived.write_text(text.replace('time,time_received', 'true,time', 1))
    truth = [one.track.times + one.track.begin for one in read_csv_tracks(folder / f'{name}.csv')]
    found, clock = on_camera_clock([one.track for one in read_csv_tracks(arrived)])
    assert clock is not None and clock.used
    for track, true in zip(found, truth, strict=True):
        off = track.times - true
        # both are zero at a first frame, whose arrival jitters too; 0.29 ms were there before, and
        # the true times have six digits and a clock that was fitted track by track
        assert np.abs(off - np.median(off)).max() < 0.02e-3
