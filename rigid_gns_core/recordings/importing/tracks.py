# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories at a model's time step from the tracked poses of one bag."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from .options import ImportBagError, Imported, ImportOptions
from .sphere_order import check_order, OrderCheck
from .stretches import fitting_scene, native_dt, resampled, SLOWEST
from .units_and_axes import turned_frames
from ..decoded_topic import decode_topic, DecodedTopic
from ..recorded_simulators import RecordedSimulators
from ..scene_frame import in_scene_frame
from ..tracked_frames import as_track, MATCH_REMEDY, Segment, segment_frames, Segmentation
from ..units import check_fall, check_speed
from ...bags.reader import Bag, read_bag
from ...bags.topics import find_poses
from ...data.records import Record
from ...forecasts.forecaster import Forecaster
from ...scenes.scene import Scene
from ...scenes.scene_file import load_scene
from ...tracking.usable_frames import GAP, seconds


def read_bag_tracks(path: str | Path, options: ImportOptions) -> Imported:
    """Trajectories of one bag at the model's time step.

    Raises:
        UserError: The bag cannot be read, or holds nothing usable.
    """
    bag = read_bag(path)
    with bag.naming_damage():
        return _tracks_of(bag, path, options)


def _tracks_of(bag: Bag, path: str | Path, options: ImportOptions) -> Imported:
    simulators = RecordedSimulators.of(bag)
    topic = find_poses(bag, 'tracked_poses', '--topic', options.topic, simulators.tracked)
    scene = simulators.scene(topic.name) if options.scene is None else load_scene(options.scene)
    scene = scene if options.radius is None else replace(scene, radius=options.radius)
    dt = options.dt or native_dt(scene, options.model)
    metres = turned_frames(decode_topic(topic), options.scale, 'z')
    decoded = turned_frames(in_scene_frame(bag, metres, options.frame), 1.0, options.up)
    interval = decoded.interval(f'{path}: {topic.name}')
    if interval > SLOWEST * dt:
        raise ImportBagError(
            f'{path}: frames of {topic.name} are {interval:.3g} s apart, expected at most '
            f'{SLOWEST:g} time steps of {dt:.3g} s; track faster, or give a longer --dt'
        )
    gap = options.max_gap or GAP * max(dt, interval)
    parts, matched = _segment(decoded, scene, options, simulators, topic.name, gap)
    noise = parts.noise()
    check_fall([as_track(p, '') for p in parts.segments], scene, noise.position, f'{path}')
    usable = [part for part in parts.segments if part.times[-1] >= (options.min_steps - 1e-6) * dt]
    if not usable:
        radius = float(np.max(scene.radius))
        longest = max((part.times[-1] for part in parts.segments), default=0.0)
        raise ImportBagError(
            f'{path}: no stretch of {topic.name} is {options.min_steps} steps of {dt:.3g} s long, '
            f'the longest has {longest:.3g} s (frames refused: {parts.refused or "none"}; cuts: '
            f'{parts.cuts or "none"}); '
            + (decoded.refusal(radius) or 'record for longer, or lower --min-steps')
            + (f'; {MATCH_REMEDY}' if 'count' in parts.cuts else '')
        )
    counts: Counter[str] = Counter()
    records = []
    where = f'{path}: {topic.name}'
    scenes = [fitting_scene(part, scene, noise, where) for part in usable]
    warnings = [] if matched else _check_order(usable, scene, where)
    tracks = [as_track(part, f'{Path(path).stem}_{k}') for k, part in enumerate(usable)]
    if not warnings:  # else hardly a motion is seen
        check_speed(tracks, scene, where)
    for number, (part, own) in enumerate(zip(usable, scenes, strict=True)):
        trajectory = resampled(part, own, dt, noise, counts)
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
        'file': Path(path).name,
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
    return Imported(records, tracks, scene, report)


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
        return segment_frames(decoded, scene, gap * 1e9), why
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
