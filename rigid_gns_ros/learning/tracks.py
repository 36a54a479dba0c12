# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Trajectories at a model's time step from the tracked poses of one bag. No ROS needed."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
import json
from pathlib import Path
from typing import Any

import numpy as np
from rigid_gns_core.checkpoint import find_model, load_card
from rigid_gns_core.config import from_mapping
from rigid_gns_core.dataset import Record
from rigid_gns_core.sampling import load_scene
from rigid_gns_core.scene import Scene
from rigid_gns_core.similarity import ModelUnits, Similarity
from rigid_gns_core.state import Trajectory
from rigid_gns_core.tracked_motion import PoseNoise

from .resample import resample
from .tracked_segments import cut, find_tracked, Segment
from ..bag_reader import Bag, BagError, read_bag
from ..evaluation.alignment import decode_topic
from ..messages import decode_string, MessageError
from ..recording.bag_topics import listing

# frames of the tracker further apart than this many time steps of the data are too few
_SLOWEST = 2.0
# a gap is longer than this many time steps, or intervals of a tracker that is slower: at most one
# step is missing
_GAP = 2.5
# a centre so many radii behind a surface is no measurement of a sphere in this scene
_BEHIND = 0.2


class ImportBagError(ValueError):
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
        max_gap: Frames further apart are not joined [s]; None: 2.5 time steps, or 2.5 intervals of
            the tracker where these are longer.
        min_steps: Shorter stretches are left out.
    """

    topic: str | None = None
    scene: str | Path | None = None
    radius: float | None = None
    model: str = ''
    dt: float | None = None
    max_gap: float | None = None
    min_steps: int = 10

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
        ValueError: It cannot be read, or holds nothing that can be used.
    """
    bag = read_bag(path)
    scenes = _recorded(bag)
    topic = find_tracked(bag, options.topic, [name for name, _ in scenes])
    scene = _scene(bag, topic.name, scenes, options)
    dt = options.dt or _native_dt(scene, options.model)
    decoded = decode_topic(topic)
    stamps = np.array([frame.stamp_ns for frame in decoded.frames], dtype=np.int64)
    rising = np.diff(stamps)[np.diff(stamps) > 0] * 1e-9
    if not len(rising):
        raise ImportBagError(
            f'{path}: {topic.name} holds {len(stamps)} frames, no two of which follow each other'
        )
    interval = float(np.median(rising))
    if interval > _SLOWEST * dt:
        raise ImportBagError(
            f'{path}: frames of {topic.name} are {interval:.3g} s apart, expected at most '
            f'{_SLOWEST:g} time steps of {dt:.3g} s; track faster, or give a longer --dt'
        )
    gap = options.max_gap or _GAP * max(dt, interval)
    parts = cut(decoded.frames, gap * 1e9)
    noise = parts.noise()
    usable = [part for part in parts.segments if part.times[-1] >= (options.min_steps - 1e-6) * dt]
    if not usable:
        longest = max((part.times[-1] for part in parts.segments), default=0.0)
        raise ImportBagError(
            f'{path}: no stretch of {topic.name} is {options.min_steps} steps of {dt:.3g} s long, '
            f'the longest has {longest:.3g} s (frames refused: {parts.refused or "none"}; cuts: '
            f'{parts.cuts or "none"}); record for longer, or lower --min-steps'
        )
    counts: Counter[str] = Counter()
    records = []
    for number, part in enumerate(usable):
        where = f'{path}: {topic.name}'
        _check_fits(part, scene, noise, where)
        trajectory = _trajectory(part, scene, dt, noise, counts)
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
        records.append(
            Record(trajectory=trajectory, scene=scene, seed=0, teacher=origin, name=name)
        )
    report = {
        'bag': Path(path).name,
        'topic': topic.name,
        'frames': len(topic),
        'damaged': decoded.damaged,
        'refused': parts.refused,
        'cuts': parts.cuts,
        'too_short': len(parts.segments) - len(usable),
        'interval_s': interval,
        'dt_s': dt,
        'noise_m': noise.position,
        'noise_rad': noise.rotation,
        'records': [[r.trajectory.count, r.trajectory.steps] for r in records],
        'poses': dict(counts),
        'warnings': list(bag.warnings),
    }
    return Imported(records, report)


def _recorded(bag: Bag) -> list[tuple[str, dict[str, Any]]]:
    """(Tracked topic, scene) of each simulator that recorded itself; '' where it named none."""
    found = []
    for topic in bag.topics.values():
        if not (topic.type_name == 'std_msgs/msg/String' and topic.name.endswith('/scene')):
            continue
        for message in topic.messages[-1:]:
            try:
                content = json.loads(decode_string(message))
            except (MessageError, json.JSONDecodeError) as error:
                raise BagError(f'{bag.path}: {topic.name} holds no JSON: {error}') from error
            if isinstance(content, dict) and 'scene' in content:
                names = content.get('topics')
                tracked = names.get('tracked', '') if isinstance(names, dict) else ''
                found.append((str(tracked), content['scene']))
    return found


def _scene(
    bag: Bag, topic: str, scenes: list[tuple[str, dict[str, Any]]], options: ImportOptions
) -> Scene:
    if options.scene is not None:
        scene = load_scene(options.scene)[0]
    else:
        own = [scene for name, scene in scenes if name == topic] or [s for _, s in scenes]
        if not own or any(scene != own[0] for scene in own):
            problem = 'no .../scene topic says' if not own else f'{len(own)} simulators differ in'
            raise BagError(
                f'{bag.path}: {problem} what the scene is; name it with --scene. '
                f'The bag holds {listing(bag)}'
            )
        scene = Scene.from_mapping(own[0], 'scene of the bag')
    return scene if options.radius is None else replace(scene, radius=options.radius)


def _native_dt(scene: Scene, model: str) -> float:
    path = find_model(model)
    units = from_mapping(ModelUnits, load_card(path)['units'], f'{path}: units')
    return units.dt * Similarity.between(scene, units).time


def _check_fits(part: Segment, scene: Scene, noise: PoseNoise, where: str) -> None:
    """Refuse a scene of another number of spheres, or with surfaces that these lie behind."""
    count = part.poses.shape[1]
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
        gravity=np.asarray(scene.gravity, dtype=np.float64),
        noise=noise.position,
        radius=float(np.min(scene.radius)),
    )
    counts.update(found.counts)
    return Trajectory.from_poses(found.positions, found.quaternions, dt)
