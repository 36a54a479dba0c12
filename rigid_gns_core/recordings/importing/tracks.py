# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories at a model's time step from the tracked poses of one bag."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .sphere_order import check_order, OrderCheck
from ..recorded_simulators import RecordedSimulators
from ..resample import resample
from ..tracked_frames import (
    decode_topic,
    DecodedTopic,
    MATCH_REMEDY,
    Segment,
    segment_frames,
    Segmentation,
)
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

# largest interval between tracked frames [time steps of the data]
_SLOWEST = 2.0
# a centre further behind a surface does not fit the scene [radii]
_BEHIND = 0.2


class ImportBagError(UserError):
    """A bag holds nothing to import, or does not fit its scene."""


@dataclass(frozen=True)
class ImportOptions:
    """Options of the import.

    Args:
        topic: Topic of the tracked poses; None: that of the simulator, else .../tracked_poses.
        scene: Shipped name or YAML file; None: the scene that the simulator recorded.
        radius: Radius of all spheres [m]; None: that of the scene.
        model: Model whose time step the data get, for the scene's radius and gravity.
        dt: Time step [s]; None: that of the model.
        max_gap: Longest time between frames of a segment [s]; None: two missing frames, of the
            data or of the tracker, whichever is slower.
        min_steps: Least number of steps of a segment.
        match: Whether poses are associated with tracks, as they come in any order or are missing;
            always where the simulator that recorded them did so.
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
    """Import of one bag.

    Args:
        records: Trajectories.
        report: Counts, noise and warnings, for the user and for the recipe.
    """

    records: list[Record]
    report: dict[str, Any]


def read_tracks(path: str | Path, options: ImportOptions = ImportOptions()) -> Imported:
    """Trajectories of one bag at the model's time step.

    Raises:
        UserError: The bag cannot be read, or holds nothing usable.
    """
    bag = read_bag(path)
    simulators = RecordedSimulators.of(bag)
    topic = find_poses(bag, 'tracked_poses', '--topic', options.topic, simulators.tracked)
    scene = simulators.scene(topic.name) if options.scene is None else load_scene(options.scene)
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
    parts, matched = _segment(decoded, scene, options, simulators, topic.name, gap)
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
    warnings = [] if matched else _check_order(usable, scene, where)
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


def _segment(
    decoded: DecodedTopic,
    scene: Scene,
    options: ImportOptions,
    simulators: RecordedSimulators,
    topic: str,
    gap: float,
) -> tuple[Segmentation, str]:
    """Segments of the frames, and why poses were matched, as text; empty: they were not."""
    parameters = simulators.parameters(topic)
    matched = parameters.get('match_spheres', False)
    why = 'as --match asks' if options.match else ''
    why = 'as by the simulator that recorded the bag' if matched else why
    if not why:
        return segment_frames(decoded, float(np.max(scene.radius)), gap * 1e9), why
    # late: the model need not run otherwise
    from ..matched_frames import segment_matched_frames

    model = Forecaster(options.model, scene)
    return segment_matched_frames(decoded, model, parameters if matched else {}, gap * 1e9), why


def _check_order(parts: list[Segment], scene: Scene, where: str) -> list[str]:
    """Check the order of the spheres.

    Returns:
        Warnings of single exchanges, and of poses that show no motion.

    Raises:
        ImportBagError: The poses are in no fixed order.
    """
    gravity = np.asarray(scene.gravity, dtype=np.float64)
    order = OrderCheck()
    for part in parts:
        order += check_order(part, scene.per_sphere('radius', part.poses.shape[1]), gravity)
    if order.unordered:
        raise ImportBagError(
            f'{where}: spheres change places in the message, in {len(order.stamps)} frames, the '
            f'first of stamp {seconds(order.stamps[0])} s; expected each in its own place '
            'throughout; --match finds out who is who'
        )
    warnings = []
    if order.stamps:
        warnings.append(
            f'spheres seem to change places in the message, in {len(order.stamps)} frames, the '
            f'first of stamp {seconds(order.stamps[0])} s; --match finds out who is who'
        )
    if order.no_motion:
        warnings.append(
            f'{100 * order.jumps / order.steps:.3g} % of the steps of spheres do not go on from '
            'the step before, so hardly a motion is seen; track faster, or, if poses come in any '
            'order, try --match'
        )
    return warnings


def _native_dt(scene: Scene, model: str) -> float:
    return load_simulator(model).native_dt(scene)


def _fitting(part: Segment, scene: Scene, noise: PoseNoise, where: str) -> Scene:
    """The scene for the spheres of a segment.

    Raises:
        ImportBagError: It is of another number of spheres, or spheres lie behind its surfaces.
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
        if not plane.is_half_space:
            continue  # it has a second face
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
    resampled = resample(
        times,
        part.poses[..., :3],
        part.poses[..., 3:],
        np.minimum(dt * np.arange(steps + 1), times[-1]),
        scene=scene,
        noise=noise.position,
    )
    counts.update(resampled.counts)
    return Trajectory.from_poses(resampled.positions, resampled.quaternions, dt)
