# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories at a model's time step from the tracked poses of one bag. No ROS needed."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .kept_places import places_kept, PlacesKept
from ..recorded_scenes import SaidScenes
from ..resample import resample
from ..tracked_frames import Cut, cut, decode_topic, Decoded, MATCH_REMEDY, Segment
from ...bags.reader import read_bag
from ...bags.topics import find_poses
from ...data.records import Record
from ...errors import UserError
from ...forecasts.forecaster import Forecaster, scene_of
from ...prediction.load import load_simulator
from ...scenes.scene import Scene
from ...scenes.scene_file import load_scene
from ...scenes.state import Trajectory
from ...tracking.pose_noise import PoseNoise
from ...tracking.usable_frames import GAP, seconds

# frames of the tracker further apart than this many time steps of the data are too few
_SLOWEST = 2.0
# a centre so many radii behind a surface is no measurement of a sphere in this scene
_BEHIND = 0.2


class ImportBagError(UserError):
    """A bag holds nothing to learn from, or does not fit its scene."""


@dataclass(frozen=True)
class ImportOptions:
    """How bags are read.

    Args:
        topic: Topic of the tracked poses; None: that of the simulator, else .../tracked_poses.
        scene: Shipped name or YAML file; None: the scene that the simulator recorded.
        radius: Radius of all spheres instead of the scene's [m].
        model: Model whose time step the data get, for the scene's radius and gravity.
        dt: Time step instead of that [s].
        max_gap: Frames further apart are not joined [s]; None: where more than two time steps, or
            frames of a tracker that is slower, are missing.
        min_steps: Shorter stretches are left out.
        match: Whether poses are matched to spheres, which come in any order or are missing; also
            where the simulator that recorded them did.
    """

    topic: str | None = None
    scene: str | Path | None = None
    radius: float | None = None
    model: str = ''
    dt: float | None = None
    max_gap: float | None = None
    min_steps: int = 10
    match: bool = False

    def __post_init__(self) -> None:
        for name in ('radius', 'dt', 'max_gap'):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise ImportBagError(f'{name} is {value}, expected a positive number')
        if self.min_steps < 3:
            raise ImportBagError(
                f'min_steps is {self.min_steps}, expected at least 3, which training windows need'
            )


@dataclass(frozen=True)
class Imported:
    """What one bag gave.

    Args:
        records: Trajectories.
        report: Counts, noise and warnings, for people and for the recipe.
    """

    records: list[Record]
    report: dict[str, Any]


def read_tracks(path: str | Path, options: ImportOptions = ImportOptions()) -> Imported:
    """Trajectories of one bag at the model's time step.

    Raises:
        UserError: It cannot be read, or holds nothing that can be used.
    """
    bag = read_bag(path)
    said = SaidScenes.of(bag)
    topic = find_poses(bag, 'tracked_poses', '--topic', options.topic, said.tracked)
    scene = said.scene(topic.name) if options.scene is None else load_scene(options.scene)
    scene = scene if options.radius is None else replace(scene, radius=options.radius)
    dt = options.dt or _native_dt(scene, options.model)
    decoded = decode_topic(topic)
    interval = decoded.interval(f'{path}: {topic.name}')
    if interval > _SLOWEST * dt:
        raise ImportBagError(
            f'{path}: frames of {topic.name} are {interval:.3g} s apart, expected at most '
            f'{_SLOWEST:g} time steps of {dt:.3g} s; track faster, or give a longer --dt'
        )
    gap = options.max_gap or GAP * max(dt, interval)
    parts, matched = _cut(decoded, scene, options, said, topic.name, gap)
    noise = parts.noise()
    usable = [part for part in parts.segments if part.times[-1] >= (options.min_steps - 1e-6) * dt]
    if not usable:
        longest = max((part.times[-1] for part in parts.segments), default=0.0)
        raise ImportBagError(
            f'{path}: no stretch of {topic.name} is {options.min_steps} steps of {dt:.3g} s long, '
            f'the longest has {longest:.3g} s (frames refused: {parts.refused or "none"}; cuts: '
            f'{parts.cuts or "none"}); record for longer, or lower --min-steps'
            + (f'; {MATCH_REMEDY}' if 'count' in parts.cuts else '')
        )
    counts: Counter[str] = Counter()
    records = []
    where = f'{path}: {topic.name}'
    scenes = [_fitting(part, scene, noise, where) for part in usable]
    warnings = [] if matched else _check_places(usable, scene, where)
    for number, (part, own) in enumerate(zip(usable, scenes, strict=True)):
        trajectory = _trajectory(part, own, dt, noise, counts)
        origin = {
            'engine': 'tracker',
            'bag': Path(path).name,
            'topic': topic.name,
            'stamp_ns': int(part.stamps[0]),
            'interval_s': interval,
            'noise_m': noise.position,
            'noise_rad': noise.rotation,
        }
        name = f'{Path(path).stem}_{number}'
        records.append(Record(trajectory=trajectory, scene=own, seed=0, teacher=origin, name=name))
    report = {
        'bag': Path(path).name,
        'topic': topic.name,
        'frames': len(topic),
        'damaged': decoded.damaged,
        'matched': matched,
        'filled': parts.filled,
        'refused': parts.refused,
        'cuts': parts.cuts,
        'too_short': len(parts.segments) - len(usable),
        'interval_s': interval,
        'dt_s': dt,
        'noise_m': noise.position,
        'noise_rad': noise.rotation,
        'records': [[r.trajectory.count, r.trajectory.steps] for r in records],
        'poses': dict(counts),
        'warnings': warnings + list(bag.warnings),
    }
    return Imported(records, report)


def _cut(
    decoded: Decoded,
    scene: Scene,
    options: ImportOptions,
    said: SaidScenes,
    topic: str,
    gap: float,
) -> tuple[Cut, str]:
    """Cut frames into segments, and say who asked for matching; empty: nobody."""
    parameters = said.parameters(topic)
    matched = parameters.get('match_spheres', False)
    why = 'as --match asks' if options.match else ''
    why = 'as by the simulator that recorded the bag' if matched else why
    if not why:
        return cut(decoded, float(np.max(scene.radius)), gap * 1e9), why
    # late: the model need not run otherwise
    from ..matched_frames import cut_matched

    model = Forecaster(options.model, scene)
    return cut_matched(decoded, model, parameters if matched else {}, gap * 1e9), why


def _check_places(parts: list[Segment], scene: Scene, where: str) -> list[str]:
    """Refuse poses that come in any order; warn of some that do, and of such as show no motion."""
    gravity = np.asarray(scene.gravity, dtype=np.float64)
    found = PlacesKept()
    for part in parts:
        found += places_kept(part, scene.per_sphere('radius', part.poses.shape[1]), gravity)
    if found.lost:
        raise ImportBagError(
            f'{where}: spheres change places in the message, in {len(found.stamps)} frames, the '
            f'first of stamp {seconds(found.stamps[0])} s; expected each in its own place '
            'throughout; --match finds out who is who'
        )
    warnings = []
    if found.stamps:
        warnings.append(
            f'spheres seem to change places in the message, in {len(found.stamps)} frames, the '
            f'first of stamp {seconds(found.stamps[0])} s; --match finds out who is who'
        )
    if found.blind:
        warnings.append(
            f'{100 * found.sudden / found.steps:.3g} % of the steps of spheres do not go on from '
            'the step before, so hardly a motion is seen; track faster, or, if poses come in any '
            'order, try --match'
        )
    return warnings


def _native_dt(scene: Scene, model: str) -> float:
    return load_simulator(model).native_dt(scene)


def _fitting(part: Segment, scene: Scene, noise: PoseNoise, where: str) -> Scene:
    """Return the scene of these spheres.

    Raises:
        ImportBagError: It is of another number of spheres, or has surfaces that these lie behind.
    """
    count = part.poses.shape[1]
    if part.ids is not None:
        try:
            scene = scene_of(scene, part.ids)
        except UserError as error:
            raise ImportBagError(f'{where}: {error}') from error
    if scene.sphere_count not in (None, count):
        raise ImportBagError(
            f'{where} has stretches with {count} spheres, but the scene has properties of '
            f'{scene.sphere_count}; give a --scene with one number for all, or bags of '
            f'{scene.sphere_count} spheres'
        )
    radius = scene.per_sphere('radius', count)
    allowed = _BEHIND * radius + 5.0 * noise.position
    for index, plane in enumerate(scene.surfaces):
        if not (np.isinf(plane.length_x) and np.isinf(plane.length_y)):
            continue
        depth = (np.asarray(plane.point) - part.poses[..., :3]) @ np.asarray(plane.normal)
        if (depth > allowed).any():
            frame, sphere = np.unravel_index(int((depth - allowed).argmax()), depth.shape)
            raise ImportBagError(
                f'{where}: the centre of sphere {sphere} is {depth[frame, sphere]:.3g} m behind '
                f'surface {index} of the scene at {part.times[frame]:.3g} s, expected in front of '
                'it; are positions in metres, z up, and is it the right --scene?'
            )
    return scene


def _trajectory(
    part: Segment, scene: Scene, dt: float, noise: PoseNoise, counts: Counter[str]
) -> Trajectory:
    times = part.times
    steps = int(np.floor(times[-1] / dt + 1e-6))
    found = resample(
        times,
        part.poses[..., :3],
        part.poses[..., 3:],
        np.minimum(dt * np.arange(steps + 1), times[-1]),
        scene=scene,
        noise=noise.position,
    )
    counts.update(found.counts)
    return Trajectory.from_poses(found.positions, found.quaternions, dt)
