# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A small bag of a simulator, and changes of its bytes, messages and texts."""

from __future__ import annotations

from io import BytesIO
import json

from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader
from mcap.writer import CompressionType, Writer
import numpy as np

from .mutations import mutated_bytes, mutated_text
from ...forecasts.starts import Start
from ...messages.definitions import full_text
from ...messages.poses import decode_string, encode_float64, encode_string, PoseArrayCodec
from ...messages.trajectories import encode_trajectory
from ...scenes.scene import Scene

# topic, type, log time [ns], bytes
Message = tuple[str, str, int, bytes]

_POSES, _STRING = 'geometry_msgs/msg/PoseArray', 'std_msgs/msg/String'
_BEGIN, _STEP, _FRAMES, _STARTED = 1_700_000_000_000_000_000, 10_000_000, 40, 5  # [ns]
_COMPRESSIONS = (CompressionType.NONE, CompressionType.ZSTD, CompressionType.LZ4)


def small_bag() -> bytes:
    """Two balls that fall, tracked and predicted, with all topics of the simulator."""
    scene = Scene(radius=0.02, mass=0.0027)
    said = {
        'scene': scene.to_mapping(),
        'model': 'laws',
        'model_card': {},
        'dt': _STEP * 1e-9,
        'period': _STEP * 1e-9,
        'parameters': {'start': 'first', 'velocity_window': 6, 'match_spheres': False},
        'topics': {'tracked': '/tracked_poses', 'predicted': '/predicted_poses'},
    }
    stamps = tuple(_BEGIN + k * _STEP for k in range(_STARTED + 1))
    start = Start(stamps[-1], stamps, 'first', (0, 1), 1e-4)
    messages: list[Message] = [
        ('/simulator/scene', _STRING, _BEGIN, encode_string(json.dumps(said)))
    ]
    codec = PoseArrayCodec('world', 2)
    for k in range(_FRAMES):
        stamp, poses = _BEGIN + k * _STEP, falling(k * _STEP * 1e-9)
        messages.append(('/tracked_poses', _POSES, stamp + 1000, codec.encode(poses, stamp)))
        if k == _STARTED:
            messages.append(('/simulator/start', _STRING, stamp + 2000, encode_string(start.json)))
            future = encode_trajectory(
                stamp,
                'world',
                ('sphere_0', 'sphere_1'),
                (0, _STEP),
                np.stack([poses, falling((k + 1) * _STEP * 1e-9)]),
                np.zeros((2, 2, 6)),
            )
            kind = 'trajectory_msgs/msg/MultiDOFJointTrajectory'
            messages.append(('/predicted_trajectory', kind, stamp + 3000, future))
        if k > _STARTED:
            time = stamp + 4000
            messages.append(('/predicted_poses', _POSES, time, codec.encode(poses, stamp)))
            step = 'std_msgs/msg/Float64'
            messages.append(('/simulator/step_time', step, time, encode_float64(1e-4)))
    return written(messages, CompressionType.NONE)


def falling(time: float) -> np.ndarray:
    """Poses of two balls in free flight, shape (2, 7)."""
    poses = np.zeros((2, 7))
    poses[:, 0], poses[:, 6] = (0.0, 0.5), 1.0
    poses[:, 2] = 2.0 - 0.5 * 9.81 * time**2
    return poses


def written(messages: list[Message], compression: CompressionType) -> bytes:
    """An MCAP file without checksums, as rosbag2 writes it."""
    stream = BytesIO()
    writer = Writer(stream, chunk_size=4096, compression=compression, enable_crcs=False)
    writer.start('ros2', 'another recorder')
    channels: dict[tuple[str, str], int] = {}
    for topic, kind, time, cdr in messages:
        if (topic, kind) not in channels:
            schema = writer.register_schema(kind, 'ros2msg', full_text(kind).encode())
            channels[topic, kind] = writer.register_channel(topic, 'cdr', schema)
        writer.add_message(channels[topic, kind], time, cdr, time)
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()


def mutated_bag(data: bytes, rng: np.random.Generator) -> bytes:
    """Half of the time other bytes; else other messages, texts and times in an intact file."""
    try:
        reader = NonSeekingReader(BytesIO(data))
        messages = [
            (channel.topic, schema.name if schema else _STRING, message.log_time, message.data)
            for schema, channel, message in reader.iter_messages()
        ]
    except (McapError, ValueError):  # it is damaged already
        return mutated_bytes(data, rng)
    if rng.random() < 0.5 or not messages:
        compression = _COMPRESSIONS[int(rng.integers(3))]
        return mutated_bytes(written(messages, compression), rng)
    for _ in range(int(rng.integers(1, 5))):
        place = _rare_or_any(messages, rng)
        topic, kind, time, cdr = messages[place]
        how = int(rng.integers(5))
        if how == 0:
            time = int(rng.choice([0, 1, 2**63 - 1, 2**62, time - 10**9, time + 10**9]))
        elif how == 1:
            messages.insert(int(rng.integers(len(messages))), messages.pop(place))
            continue
        elif how == 2:
            del messages[place : place + int(rng.integers(1, 20))]
            if not messages:
                break
            continue
        elif kind == _STRING:
            text = mutated_text(decode_string(cdr).encode(), rng).decode('utf-8', 'ignore')
            cdr = encode_string(text.replace('\0', ''))
        else:
            cdr = mutated_bytes(cdr, rng)
        messages[min(place, len(messages) - 1)] = topic, kind, time, cdr
    return written(messages, CompressionType.NONE)


def _rare_or_any(messages: list[Message], rng: np.random.Generator) -> int:
    """Index of a message, half of the time of one of the few that are not poses."""
    rare = [k for k, message in enumerate(messages) if message[1] != _POSES]
    if rare and rng.random() < 0.5:
        return rare[int(rng.integers(len(rare)))]
    return int(rng.integers(len(messages)))
