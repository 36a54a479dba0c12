# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracks of one CSV file: on the camera's clock, in metres, looked at before they are used."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from .camera_clock import on_camera_clock
from .options import ImportBagError, Imported, ImportOptions
from .stretches import native_dt, resampled, SLOWEST
from .track_checks import problem_of
from .units_and_axes import turned
from ..tracked_frames import Segment
from ..units import check_fall, check_speed
from ...data.csv_tracks import CsvTrack, read_csv_tracks
from ...data.records import Record
from ...data.tracks import sorted_labels, Track
from ...forecasts.forecaster import scene_of
from ...scenes.scene import Scene
from ...scenes.scene_file import load_scene
from ...scenes.state import Array
from ...tracking.lost_spheres import lost_at_origin
from ...tracking.pose_noise import estimate_noise, PoseNoise
from ...tracking.unknown_rotations import whole_rotations
from ...tracking.usable_frames import GAP

_UNTURNED = (0.0, 0.0, 0.0, 1.0)
# no tracker of moving balls is slower [s]
_SLOW = 1.0


def import_csv(path: Path, options: ImportOptions) -> Imported:
    """Tracks of a CSV file, and trajectories at the model's time step where they can be made.

    Raises:
        UserError: The file cannot be read, units or axes are not those of the scene, or a track
            is bad; the message names file, line, track and sphere, the bound and the remedy.
    """
    if options.scene is None:
        raise ImportBagError(
            f'{path}: a CSV file says nothing of its scene; give --scene NAME or FILE'
        )
    scene = load_scene(options.scene)
    scene = scene if options.radius is None else replace(scene, radius=options.radius)
    read = read_csv_tracks(path)
    read = [replace(one, track=without_lost(one.track)) for one in read]
    tracks, clock = on_camera_clock([one.track for one in read])
    tracks = [turned(track, options.scale, options.up) for track in tracks]
    labels = sorted_labels(label for track in tracks for label in track.spheres)
    if scene.sphere_count not in (None, len(labels)):
        raise ImportBagError(
            f'{path}: there are {len(labels)} spheres ({", ".join(labels[:10])}), but the scene '
            f'has properties of {scene.sphere_count}; give one number for all in the scene, or '
            'one per sphere in the order of their numbers'
        )
    _check_interval(tracks, path)
    noise = noise_of_tracks(tracks)
    check_fall(tracks, scene, noise, str(path))
    checked = [
        replace(one, track=replace(track, name=f'{path.stem}_{track.name}'))
        for one, track in zip(read, tracks, strict=True)
    ]
    kept, left_out = _usable(checked, scene, noise, labels, skip=options.skip_bad)
    check_speed(kept, scene, str(path))  # not before: of two balls with one number it is large
    records, counts, why = _records(kept, scene, labels, noise, options)
    report = {
        'file': path.name,
        'tracks': len(kept),
        'samples': int(sum(track.seen.sum() for track in kept)),
        'spheres': list(labels),
        'clock': None if clock is None else str(clock),
        'scale': options.scale,
        'up': options.up,
        'interval_s': float(np.median(np.concatenate([np.diff(t.times) for t in kept]))),
        'noise_m': noise,
        'left_out': left_out,
        'records': [[r.trajectory.count, r.trajectory.steps] for r in records],
        'dt_s': records[0].trajectory.dt if records else None,
        'poses': dict(counts),
        'no_records': why,
    }
    return Imported(records, kept, scene, report)


def _check_interval(tracks: Sequence[Track], path: Path) -> None:
    spans = np.concatenate([np.zeros(0), *(np.diff(track.times) for track in tracks)])
    if len(spans) and (usual := float(np.median(spans))) > _SLOW:
        raise ImportBagError(
            f'{path}: rows are {usual:.4g} s apart, expected at most {_SLOW:g} s; write times in '
            'seconds, not in milliseconds or nanoseconds'
        )


def without_lost(track: Track) -> Track:
    """The track with NaN where a ball was lost, see `lost_at_origin`."""
    lost = lost_at_origin(track.positions)
    if not lost.any():
        return track
    turns = track.quaternions
    return replace(
        track,
        positions=np.where(lost[..., None], np.nan, track.positions),
        quaternions=None if turns is None else np.where(lost[..., None], np.nan, turns),
    )


def noise_of_tracks(tracks: Sequence[Track]) -> float:
    """Standard deviation of each coordinate of a position [m], see `estimate_noise`."""
    segments = []
    for track in tracks:
        for sphere in range(len(track.spheres)):
            times, places = track.samples(sphere)
            if len(times):
                # a coordinate that was not measured, as heights of an overhead camera, has none
                places = places[:, None, np.ptp(places, axis=0) > 0]
                segments.append((times, places, np.tile(_UNTURNED, (len(times), 1, 1))))
    return estimate_noise(segments).position


def _usable(
    checked: Sequence[CsvTrack], scene: Scene, noise: float, labels: Sequence[str], *, skip: bool
) -> tuple[list[Track], list[str]]:
    """Tracks without a problem, and the problems of the others.

    Raises:
        ImportBagError: A track is bad and not skipped, or all are bad.
    """
    radius = dict(zip(labels, scene.per_sphere('radius', len(labels)), strict=True))
    kept, bad = [], []
    for one in checked:
        radii = np.array([radius[label] for label in one.track.spheres])
        if problem := problem_of(one, scene, noise, radii):
            bad.append(problem)
        else:
            kept.append(one.track)
    if bad and not (skip and kept):
        more = f' ({len(bad)} of {len(checked)} tracks are bad' if len(checked) > 1 else ''
        more += '; --skip-bad leaves them out)' if more and kept else ')' if more else ''
        raise ImportBagError(bad[0] + more)
    return kept, bad


def _records(
    tracks: Sequence[Track],
    scene: Scene,
    labels: Sequence[str],
    noise: float,
    options: ImportOptions,
) -> tuple[list[Record], Counter[str], str]:
    """Trajectories at a time step, what their poses come from, and why there are none."""
    dt = options.dt or native_dt(scene, options.model)
    counts: Counter[str] = Counter()
    records, longest, intervals = [], 0.0, []
    for track in tracks:
        ids = tuple(labels.index(label) for label in track.spheres)
        own = scene_of(scene, ids)
        for number, part in enumerate(_stretches(track, options, dt)):
            intervals.append(float(np.median(np.diff(part.times))))
            longest = max(longest, float(part.times[-1]))
            if part.times[-1] < (options.min_steps - 1e-6) * dt or intervals[-1] > SLOWEST * dt:
                continue
            trajectory = resampled(part, own, dt, PoseNoise(noise, None), counts)
            origin = {'engine': 'tracker', 'track': track.name, 'noise_m': noise}
            name = f'{track.name}_{number}'
            records.append(
                Record(trajectory=trajectory, scene=own, seed=0, teacher=origin, name=name)
            )
    if records:
        return records, counts, ''
    if not intervals:
        return [], counts, 'no two frames side by side show all spheres'
    need = f'{options.min_steps} steps of {dt:.3g} s, frames at most {SLOWEST * dt:.3g} s apart'
    why = (
        f'no stretch that shows all spheres is long and dense enough ({need}); the longest has '
        f'{longest:.3g} s, frames are {float(np.median(intervals)):.3g} s apart'
    )
    return [], counts, why


def _stretches(track: Track, options: ImportOptions, dt: float) -> list[Segment]:
    """Frames that show all spheres, cut at gaps; those of two frames and more."""
    whole = np.flatnonzero(track.seen.all(axis=1))
    if len(whole) < 2:
        return []
    spans = np.diff(track.times[whole])
    gap = options.max_gap or GAP * max(dt, float(np.median(spans)))
    stamps = np.rint(track.times * 1e9).astype(np.int64)
    found = []
    for part in np.split(whole, np.flatnonzero(spans > gap) + 1):
        if len(part) >= 2:
            found.append(Segment(stamps[part], _poses(track)[part]))
    return found


def _poses(track: Track) -> Array:
    """Position [m] and quaternion (x, y, z, w), shape (m, n, 7)."""
    turns = track.quaternions
    if turns is None:
        turns = np.broadcast_to(_UNTURNED, (*track.positions.shape[:2], 4))
    turns = whole_rotations(np.where(np.isfinite(turns), turns, 0.0), track.seen)
    turns = np.where(track.seen[..., None], turns, _UNTURNED)
    return np.concatenate([track.positions, turns], axis=-1)
