# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every format that is read: an intact file, how it is changed, and what reads it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
import json
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from safetensors.numpy import save

from .bags import falling, mutated_bag, small_bag
from .hdf5 import mutated_hdf5
from .mutations import mutated_bytes, mutated_text, Mutation
from ...bags.metadata import information_yaml, metadata_yaml, RecordedFile, RecordedTopic
from ...bags.reader import read_bag
from ...bags.topics import find_topics
from ...data.csv_tracks import read_csv_tracks
from ...data.recipe import load_recipe
from ...data.records import read_record, Record, write_record
from ...data.tracks import read_tracks, Track, TrackSet, write_tracks
from ...files.checkpoint import CARD_KEYS, load_card, load_weights
from ...files.config import config_folder
from ...messages.poses import decode_pose_array, decode_string, encode_string, PoseArrayCodec
from ...messages.trajectories import decode_trajectory, encode_trajectory
from ...recordings.importing.csv_import import import_csv
from ...recordings.importing.options import ImportOptions
from ...recordings.importing.tracks import read_bag_tracks
from ...recordings.scoring.evaluate import score_bag
from ...recordings.scoring.reproduce import reproduce
from ...scenes.scene import Scene
from ...scenes.scene_file import load_start
from ...scenes.state import Trajectory


@dataclass(frozen=True)
class Format:
    """A kind of file.

    Args:
        name: On the command line, and of files in the corpus.
        suffix: Of its files.
        intact: Content of intact files.
        mutate: What changes one.
        read: Reads a file as the product does; raises UserError where it cannot.
        named: Whether errors name the file; messages have none.
    """

    name: str
    suffix: str
    intact: Callable[[], list[bytes]]
    mutate: Mutation
    read: Callable[[Path], object]
    named: bool = True


def _pose_arrays() -> list[bytes]:
    poses = falling(0.1)
    empty = PoseArrayCodec('', 0).encode(np.zeros((0, 7)), 0)
    return [PoseArrayCodec('world', 2).encode(poses, 1_000_000_001), empty]


def _trajectories() -> list[bytes]:
    poses = np.stack([falling(0.1), falling(0.2)])
    names = ('sphere_0', 'sphere_1')
    return [encode_trajectory(5, 'world', names, (0, 10**8), poses, np.zeros((2, 2, 6)))]


def _metadata() -> list[bytes]:
    file, topic = RecordedFile('bag_0.mcap'), RecordedTopic('/tracked_poses', _POSES, 'reliable')
    return [metadata_yaml(information_yaml([file], [topic])).encode()]


_POSES = 'geometry_msgs/msg/PoseArray'


def _shipped(folder: str) -> Callable[[], list[bytes]]:
    return lambda: [
        path.read_bytes()
        for path in sorted((config_folder() / folder).glob('*.yaml'))
        if path.stat().st_size < 8000
    ]


def _csv() -> list[bytes]:
    rows = ['track,sphere,time,x,y,z,qx,qy,qz,qw', *_rows(0), *_rows(1)]
    plain = [row.rsplit(',', 4)[0] for row in rows]
    return ['\n'.join(lines).encode() + b'\n' for lines in (rows, plain)]


def _rows(track: int) -> list[str]:
    return [
        f'{track},{ball},{k / 120:.6f},{x:.6f},{y:.6f},{z:.6f},0,0,0,1'
        for k in range(20)
        for ball, (x, y, z) in enumerate((falling(k / 120)[:, :3] + 0.001 * track).tolist())
    ]


def _hdf5(write: Callable[[Path], Path]) -> Callable[[], list[bytes]]:
    def intact() -> list[bytes]:
        with TemporaryDirectory() as folder:
            return [write(Path(folder)).read_bytes()]

    return intact


def _record(folder: Path) -> Path:
    poses = np.stack([falling(0.1 * k) for k in range(4)])
    trajectory = Trajectory.from_poses(poses[..., :3], poses[..., 3:], dt=0.1)
    return write_record(folder / 'a.h5', Record(trajectory=trajectory, scene=Scene(), seed=0))


def _tracks(folder: Path) -> Path:
    poses = np.stack([falling(0.1 * k) for k in range(4)])
    track = Track('a', np.linspace(0.0, 0.3, 4), poses[..., :3], poses[..., 3:], ('0', '1'))
    return write_tracks(folder, TrackSet((track,), Scene(), 1e-3, {'files': []}))


def _cards() -> list[bytes]:
    card = {key: {'a': 1} for key in sorted(CARD_KEYS)} | {'format_version': 1, 'kind': 'gns'}
    return [json.dumps(card, indent=2).encode()]


def _read_bag(path: Path) -> None:
    bag = read_bag(path)
    try:
        score_bag(bag)
        with bag.naming_damage():
            reproduce(bag, find_topics(bag))
    finally:
        read_bag_tracks(path, ImportOptions(min_steps=3))


def _read_metadata(path: Path) -> None:
    folder = path.parent / f'{path.stem}_bag'
    folder.mkdir(exist_ok=True)
    (folder / 'bag_0.mcap').write_bytes(_mcap())
    (folder / 'metadata.yaml').write_bytes(path.read_bytes())
    read_bag(folder)


@cache
def _mcap() -> bytes:
    return small_bag()


def _read_csv(path: Path) -> None:
    read_csv_tracks(path)
    import_csv(path, ImportOptions(scene='table_tennis', min_steps=3))


def _read_weights(path: Path) -> None:
    load_weights(path, '')


FORMATS = {
    one.name: one
    for one in (
        Format(
            'pose-array',
            '.cdr',
            _pose_arrays,
            mutated_bytes,
            lambda path: decode_pose_array(path.read_bytes()),
            named=False,
        ),
        Format(
            'trajectory-message',
            '.cdr',
            _trajectories,
            mutated_bytes,
            lambda path: decode_trajectory(path.read_bytes()),
            named=False,
        ),
        Format(
            'string-message',
            '.cdr',
            lambda: [encode_string('a text'), encode_string('')],
            mutated_bytes,
            lambda path: decode_string(path.read_bytes()),
            named=False,
        ),
        Format('bag', '.mcap', lambda: [_mcap()], mutated_bag, _read_bag),
        Format('metadata', '.yaml', _metadata, mutated_text, _read_metadata),
        Format('scene', '.yaml', _shipped('scenes'), mutated_text, load_start),
        Format('recipe', '.yaml', _shipped('data'), mutated_text, load_recipe),
        Format('csv', '.csv', _csv, mutated_text, _read_csv),
        Format('record', '.h5', _hdf5(_record), mutated_hdf5, read_record),
        Format('tracks', '.h5', _hdf5(_tracks), mutated_hdf5, read_tracks),
        Format('card', '.json', _cards, mutated_text, load_card),
        Format(
            'weights',
            '.safetensors',
            lambda: [save({'a': np.zeros((2, 3), dtype=np.float32)})],
            mutated_bytes,
            _read_weights,
        ),
    )
}
"""Formats by name."""
