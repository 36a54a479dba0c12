# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a node published, lost and said while its tracker went wrong."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
import json
from pathlib import Path
import re
from typing import Any

from motion import poses_at, RADIUS
import numpy as np
from rigid_gns_core.bags.reader import Bag, read_bag
from rigid_gns_core.errors import UserError
from rigid_gns_core.messages.cdr import Reader
from rigid_gns_core.messages.poses import decode_pose_array
from rigid_gns_core.recordings.recorded_forecasts import recorded_starts, starts_of

COUNTS = ('accepted', 'rejected', 'lost')  # of messages on tracked_poses
# a prediction is wrong if it is so far off [radii], that soon after the frame it starts from [s];
# a ball is 1.2 radii off where a bounce lies between two model steps, as poses are interpolated
FAR, SOON = 1.5, 0.1


@dataclass(frozen=True)
class Verdict:
    """Result of one run; counts of messages.

    Args:
        published: Predictions in the bag.
        judged: Of these, those that were compared with the truth.
        wrong: Not finite, not a rotation, or too far off.
        worst: Largest error of those compared [radii].
        after: Predictions from frames after the fault, or heard then where there is no bag of it.
        sent: Messages sent on tracked_poses.
        accepted: Of these.
        refused: Of these, with a reason in the log and in diagnostics.
        lost: Of these, told as lost on the way.
        ends: Of these, before the first and after the last that came: no number tells of them.
        silent: Of these, told by nothing.
        unread: Why the bag cannot be read or evaluated; empty: it can.
        said: Warnings and errors of the log, each once, without numbers.
    """

    published: int
    judged: int
    wrong: int
    worst: float
    after: int
    sent: int
    accepted: int
    refused: int
    lost: int
    ends: int
    silent: int
    unread: str
    said: tuple[str, ...]


def judge(folder: Path, log: str) -> Verdict:
    """Judge a run by its bag, by what was sent, and by the node's log."""
    sent = json.loads((folder / 'sent.json').read_text(encoding='utf-8'))
    bag = read_bag(folder / 'bag')
    counts = _last_counts([bytes.fromhex(message) for message in sent['diagnostics']])
    accepted, refused, lost = (counts[name] for name in COUNTS)
    tracked = bag.topics['/tracked_poses'].messages
    came = [decode_pose_array(message).stamp_ns for message in (tracked[0], tracked[-1])]
    stamps = [stamp for stamp, _ in sent['frames']]
    # a recording that ended early says nothing of the last ones
    whole = len(tracked) == accepted
    ends = stamps.index(came[0]) + (stamps[::-1].index(came[1]) if whole else 0)
    published, judged, wrong, worst, after = _compare(bag, sent['frames'])
    return Verdict(
        published=published,
        judged=judged,
        wrong=wrong,
        worst=worst,
        after=after if whole else sent['heard_after'],
        sent=sent['messages'],
        accepted=accepted,
        refused=refused,
        lost=lost,
        ends=ends,
        silent=sent['messages'] - accepted - refused - lost - ends,
        unread=_unread(bag),
        said=said(log),
    )


def _compare(bag: Bag, frames: list[tuple[int, float]]) -> tuple[int, int, int, float, int]:
    """Published, judged and wrong predictions, the worst error, and how many came afterwards."""
    topic = bag.topics.get('/predicted_poses')
    if topic is None or not len(topic):
        return 0, 0, 0, 0.0, 0
    starts = recorded_starts(bag.topics.get('/simulator/start'))
    predicted = [decode_pose_array(message) for message in topic.messages]
    chosen = starts_of(starts, predicted, topic.indices)
    offsets: dict[int, set[int]] = {}  # stamp less true time, of each stamp [ns]
    for stamp, true in frames:
        offsets.setdefault(stamp, set()).add(stamp - round(true * 1e9))
    latest = 0.75 * max(true for _, true in frames)
    judged = wrong = after = 0
    worst = 0.0
    for frame, start in zip(predicted, chosen.tolist(), strict=True):
        norms = np.linalg.norm(frame.poses[:, 3:], axis=1)
        if not np.isfinite(frame.poses).all() or np.abs(norms - 1.0).max(initial=0.0) > 1e-6:
            wrong += 1
            continue
        begin = starts[start].stamp_ns if start >= 0 else 0
        known = offsets.get(begin, set())
        if frame.stamp_ns - begin > SOON * 1e9:
            continue
        judged += 1
        errors = [_error(frame.poses, (frame.stamp_ns - offset) * 1e-9) for offset in known]
        error = min(errors, default=np.inf)
        worst = max(worst, error)
        wrong += error > FAR
        after += any((begin - offset) * 1e-9 > latest for offset in known)
    return len(predicted), judged, wrong, worst, after


def _error(poses: np.ndarray, true: float) -> float:
    """Largest distance from the truth [radii]."""
    expected = poses_at(np.array([true]))[0]
    if poses.shape != expected.shape:
        return float('inf')
    return float(np.linalg.norm(poses[:, :3] - expected[:, :3], axis=1).max() / RADIUS)


def _last_counts(messages: list[bytes]) -> Counter[str]:
    """Counts in messages on /diagnostics, which only grow."""
    found: Counter[str] = Counter()
    for message in messages:
        values = _tracking(message)
        for name in COUNTS:
            found[name] = max(found[name], int(values.get(name, 0)))
    return found


def _tracking(message: bytes) -> dict[str, str]:
    """Values of the status `tracking` in a DiagnosticArray."""
    reader = Reader(message, 'DiagnosticArray')
    reader.stamp()
    reader.text('frame_id')
    for _ in range(reader.number('I', 'number of statuses')):
        reader.number('B', 'level')
        name = reader.text('name')
        reader.text('message')
        reader.text('hardware_id')
        count = reader.number('I', 'number of values')
        values = {reader.text('key'): reader.text('value') for _ in range(count)}
        if name.endswith(': tracking'):
            return values
    return {}


def _unread(bag: Bag) -> str:
    """Why the bag is not evaluated; empty: it is."""
    from rigid_gns_core.recordings.scoring.evaluate import score_bag

    try:
        score_bag(bag)
    except UserError as error:
        return str(error).splitlines()[0].replace(str(bag.path), 'BAG')
    return ''


def said(log: str) -> tuple[str, ...]:
    """Beginnings of warnings, errors and lines on the clock, each once, without numbers."""
    kinds = r'^\[(?:WARN|ERROR|FATAL)\][^:]*: (.*)$|^\[INFO\][^:]*: (the clock went .*)$'
    lines = [one or other for one, other in re.findall(kinds, log, re.MULTILINE)]
    return tuple(dict.fromkeys(map(shortened, lines)))


def shortened(line: str) -> str:
    """A line to its first comma, without numbers and paths."""
    plain = re.sub(r'[-+]?\d[\d.e+-]*', 'N', re.sub(r'/\S+', 'PATH', line))
    return re.split(r'[;,]| \(|: N| so far', plain)[0][:90].strip()


def summary(verdicts: list[dict[str, Any]]) -> dict[str, Any]:
    """Sums over the runs of one fault, the worst error, and all that was said."""
    names = ('published', 'judged', 'wrong', 'after', 'sent', 'accepted', 'refused', 'lost')
    sums = {name: sum(one[name] for one in verdicts) for name in (*names, 'ends', 'silent')}
    return {
        'runs': len(verdicts),
        **sums,
        'worst_radii': max(one['worst'] for one in verdicts),
        'recovered': sum(one['after'] > 0 for one in verdicts),
        'unread': [one['unread'] for one in verdicts if one['unread']],
        'said': list(dict.fromkeys(text for one in verdicts for text in one['said'])),
    }
