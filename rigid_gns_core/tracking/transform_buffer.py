# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Transforms between coordinate frames over time, by the rules of tf2.

Frames are a tree: each has one parent. A transform from one to another goes up to the nearest
common frame and down again. Static ones hold at all times; of the others, positions are linear and
rotations turn along the shorter arc between the two that enclose a time, and none is extrapolated.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from .rejected_frame import RejectedFrame
from ..messages.poses import PoseArrayFrame
from ..messages.transforms import Transform
from ..scenes.state import (
    Array,
    as_unit,
    quaternion_multiply,
    rotate_quaternions,
    rotation_between,
)

# as tf2: transforms older than the newest by more are dropped in a node [ns]
CACHE_NS = 10_000_000_000
# as tf2: a quaternion further from a norm of 1 is no rotation
_NORM = 0.01
# so many old transforms are dropped at once, as each time the others move
_DROPPED = 64

_INVERSE = np.array([-1.0, -1.0, -1.0, 1.0])
IDENTITY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


class NoTransform(RejectedFrame):
    """There is no transform between two frames at a time.

    Args:
        text: What is missing, and the remedy.
        may_come: Whether a later transform can change that.
    """

    def __init__(self, text: str, *, may_come: bool) -> None:
        super().__init__('transform', text)
        self.may_come = may_come


@dataclass
class _Edge:
    """Poses of a frame in its parent, by time."""

    parent: str
    static: bool
    stamps: list[int] = field(default_factory=list)  # rising [ns]
    poses: list[Array] = field(default_factory=list)


class TransformBuffer:
    """What came on /tf and /tf_static.

    Args:
        cache_ns: Transforms older than the newest of a frame by more are dropped [ns]; None: none.
    """

    def __init__(self, cache_ns: int | None = CACHE_NS) -> None:
        self._cache, self._edges = cache_ns, dict[str, _Edge]()

    def clear(self) -> None:
        """Drop all that are not static, as where time went back."""
        self._edges = {child: edge for child, edge in self._edges.items() if edge.static}

    def add(self, transforms: Iterable[Transform], *, static: bool) -> str:
        """Add transforms; what is wrong with the first that cannot be used, empty: nothing."""
        problem = ''
        for one in transforms:
            parent, child = one.parent.lstrip('/'), one.child.lstrip('/')
            norm = float(np.linalg.norm(one.pose[3:]))
            if not parent or not child or parent == child:
                wrong = 'expected two names of frames'
            elif not (np.isfinite(one.pose).all() and abs(norm - 1.0) <= _NORM):
                wrong = f'its pose is {one.pose.tolist()}, expected numbers and a rotation'
            else:
                self._put(parent, child, one, static)
                continue
            problem = problem or f'transform from {one.child!r} to {one.parent!r}: {wrong}'
        return problem

    def _put(self, parent: str, child: str, one: Transform, static: bool) -> None:
        edge = self._edges.get(child)
        pose = np.concatenate([one.pose[:3], as_unit(one.pose[3:])])
        if edge is None or static or edge.static or edge.parent != parent:
            self._edges[child] = _Edge(parent, static, [one.stamp_ns], [pose])
            return
        place = bisect_left(edge.stamps, one.stamp_ns)
        if place < len(edge.stamps) and edge.stamps[place] == one.stamp_ns:
            edge.poses[place] = pose
            return
        edge.stamps.insert(place, one.stamp_ns)
        edge.poses.insert(place, pose)
        if self._cache is not None:
            old = bisect_left(edge.stamps, edge.stamps[-1] - self._cache)
            if old > _DROPPED:
                del edge.stamps[:old], edge.poses[:old]

    def lookup(self, target: str, source: str, stamp_ns: int) -> Array:
        """Pose of the frame `source` in the frame `target` at a time, shape (7,).

        Raises:
            NoTransform: None is known; the message names both frames.
        """
        up, down = self._ancestors(source), self._ancestors(target)
        common = next((name for name in up if name in down), None)
        if common is None:
            raise NoTransform(
                f'its frame is {source!r}, expected {target!r} (parameter frame_id), and /tf and '
                '/tf_static tell no transform between them; publish one, as by `ros2 run tf2_ros '
                f'static_transform_publisher --x 0 --y 0 --z 1 --frame-id {target} '
                f'--child-frame-id {source}`',
                may_come=True,
            )
        places = []
        for chain in up, down:
            place = IDENTITY
            for name in chain[: chain.index(common)]:
                place = moved(place, self._at(name, stamp_ns))
            places.append(place)
        return moved(places[0], _inverse(places[1]))

    def in_frame(self, frame: PoseArrayFrame, target: str) -> PoseArrayFrame:
        """A tracked frame in the coordinate frame `target`, at its stamp.

        A place at exactly the origin is that of a lost marker (`lost_at_origin`), and NaN then.

        Raises:
            NoTransform: None is known; the message names both frames.
        """
        pose = self.lookup(target, frame.frame_id, frame.stamp_ns)
        poses = moved(frame.poses, pose)
        poses[(frame.poses[:, :3] == 0.0).all(axis=1), :3] = np.nan
        return replace(frame, frame_id=target, poses=poses)

    def _ancestors(self, name: str) -> list[str]:
        """A frame, its parent, and so on; each once, should they be a circle."""
        found = [name.lstrip('/')]
        while (edge := self._edges.get(found[-1])) is not None and edge.parent not in found:
            found.append(edge.parent)
        return found

    def _at(self, child: str, stamp_ns: int) -> Array:
        """Pose of a frame in its parent at a time, shape (7,)."""
        edge = self._edges[child]
        if edge.static:
            return edge.poses[0]
        after = bisect_left(edge.stamps, stamp_ns)
        if after < len(edge.stamps) and edge.stamps[after] == stamp_ns:
            return edge.poses[after]
        if not 0 < after < len(edge.stamps):
            late = after > 0
            apart = (stamp_ns - edge.stamps[-1] if late else edge.stamps[0] - stamp_ns) * 1e-9
            raise NoTransform(
                f'the transform of {child!r} in {edge.parent!r} at its stamp is not known: the '
                f'{"newest" if late else "oldest"} on /tf is {apart:.3g} s '
                f'{"older" if late else "newer"}; publish it at the rate of the tracker, with the '
                'same clock (parameter transform_timeout: how long a frame waits for it)',
                may_come=late,
            )
        first, last = edge.poses[after - 1], edge.poses[after]
        share = (stamp_ns - edge.stamps[after - 1]) / (edge.stamps[after] - edge.stamps[after - 1])
        turn = share * rotation_between(first[3:], last[3:])
        place = first[:3] + share * (last[:3] - first[:3])
        return np.concatenate([place, rotate_quaternions(first[3:], turn)])


def moved(poses: Array, by: Array) -> Array:
    """Poses, shape (..., 7), in the frame in which their own frame has the pose `by`, shape (7,).

    With rotation q and place t of that frame: p' = q p q* + t, and q' = q q_p. Of unknown
    rotations, which are zero, nothing comes to be known.
    """
    axis, real = by[3:6], by[6]
    across = np.cross(axis, poses[..., :3])
    places = poses[..., :3] + 2.0 * (real * across + np.cross(axis, across)) + by[:3]
    return np.concatenate([places, quaternion_multiply(by[3:], poses[..., 3:])], axis=-1)


def turned(twists: Array, by: Array) -> Array:
    """Twists, shape (..., 6), along the axes of the frame in which theirs has the pose `by`."""
    still = np.concatenate([np.zeros(3), by[3:]])
    parts = twists.reshape(*twists.shape[:-1], 2, 3)
    unknown = np.zeros((*parts.shape[:-1], 4))
    found = moved(np.concatenate([parts, unknown], axis=-1), still)
    return found[..., :3].reshape(twists.shape)


def _inverse(pose: Array) -> Array:
    """Pose of the frame in which another has the pose `pose`, seen from that, shape (7,)."""
    turn = pose[3:] * _INVERSE
    back = moved(pose, np.concatenate([np.zeros(3), turn]))
    return np.concatenate([-back[:3], turn])
