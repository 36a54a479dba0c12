# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A residual network acts only as far as it beats the laws on held-out tracks, or not at all.

Its outputs are multiplied by a strength s. For each s, r is the error of its rollouts over that of
the laws alone, a mean over short rollouts and over longer ones; the s of the least r is kept if
r + d < 1, with d the standard error of r over the tracks (jackknife: each is left out once), and
else s = 0, which is the laws to the bit. Springs of blows are judged first, without the network,
which then, with and without them, has to be as much better than what was kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .frames import Track
from .validation import rollout_errors
from ...data.records import Record
from ...engine.learned_network import network_of
from ...engine.options import ResidualConfig
from ...files.checkpoint import load_card, load_weights, save_weights, Tensors
from ...kernels.neighbours import Indices
from ...scenes.state import Array

STRENGTHS = (0.25, 0.5, 0.75, 1.0)
# longer rollouts [frames of the short ones], and fewest tracks that tell a standard error
_LONGER, _TRACKS = 3, 3


@dataclass(frozen=True)
class Comparison:
    """What held-out tracks say: strength, r of it, its standard error d, and whether springs act.

    Where the laws are better, the strength is 0, and r and d are those of the best other one;
    without tracks enough, they are None.
    """

    strength: float
    ratio: float | None
    deviation: float | None
    springs: bool = False

    def __str__(self) -> str:
        if self.ratio is None:
            return (
                f'fewer than {_TRACKS} held-out tracks are long enough to compare it with the '
                'laws: the network is switched off (strength 0); give more by --validation'
            )
        said = (
            f'{self.ratio:.3f} ± {self.deviation:.3f} of the error of the laws on held-out tracks'
        )
        if self.strength > 0:
            return f'{said}, with strength {self.strength:g}'
        if self.springs:
            return f'{said}, by springs of blows alone: the network is switched off (strength 0)'
        return f'{said}: no better, so that it is switched off (strength 0)'


def held_out(records: Sequence[Record], most: int) -> tuple[list[Record], list[Record]]:
    """Records to learn from, and a fifth of them, evenly spread, to compare with the laws.

    At least as many as tell a standard error, and at most `most`; none of so few that nothing
    would be left to learn from.
    """
    count = min(max(_TRACKS, len(records) // 5), most)
    if len(records) <= count:
        return list(records), []
    chosen = set(np.linspace(0, len(records) - 1, count).round().astype(int).tolist())
    parts: tuple[list[Record], list[Record]] = [], []
    for k, record in enumerate(records):
        parts[k in chosen].append(record)
    return parts


def compare(
    tensors: Tensors, model: ResidualConfig, tracks: Sequence[Track], steps: int
) -> Comparison:
    """Strength that held-out tracks choose.

    Args:
        tensors: The weights.
        model: Sizes of the network.
        tracks: Held-out ones; those too short for three times `steps` frames are left out.
        steps: Length of short rollouts [frames].
    """

    def errors(strength: float, springs: NDArray[Any]) -> Array:
        changed = tensors | {'strength': np.array([strength], np.float32), 'springs': springs}
        return rollout_errors(network_of(changed, model), tracks, (steps, _LONGER * steps))

    springs, none = tensors['springs'], np.zeros_like(tensors['springs'])
    of_laws = errors(0.0, none)
    judged = np.isfinite(of_laws).all(axis=1)
    if judged.sum() < _TRACKS:
        return Comparison(0.0, None, None)
    has_springs = bool(springs.any())
    alone = [[(0.0, springs)]] if has_springs else []
    either = (springs, none) if has_springs else (none,)
    kept, base = (0.0, none), of_laws[judged]
    for trials in [*alone, [(strength, own) for own in either for strength in STRENGTHS]]:
        made = [errors(*trial)[judged] for trial in trials]
        compared = [_ratio(own, base) for own in made]
        best = min(range(len(trials)), key=lambda k: compared[k][0])
        if sum(compared[best]) < 1:
            kept, base = trials[best], made[best]
    strength, acting = kept
    acts = strength > 0 or bool(acting.any())
    ratio, deviation = _ratio(base if acts else made[best], of_laws[judged])
    return Comparison(strength, ratio, deviation, bool(acting.any()))


def keep_what_wins(path: Path, records: Sequence[Record], steps: int) -> Comparison:
    """Write the strength that held-out records choose into weights and card at `path`.

    Args:
        path: Of the weights, without a suffix.
        records: Held-out ones.
        steps: See `compare`.
    """
    weights = path.with_name(path.name + '.safetensors')
    card = load_card(weights)
    tensors = load_weights(weights, card['weights_sha256'])
    tracks = [Track.of(record) for record in records]
    found = compare(tensors, ResidualConfig(**card['config']), tracks, steps)
    said: dict[str, Any] = {
        'strength': found.strength,
        'of_laws': found.ratio if found.ratio and math.isfinite(found.ratio) else None,
        'of_laws_standard_error': found.deviation,
        'springs': found.springs,
    }
    card['validation'] |= said
    kept = {'strength': np.array([found.strength], np.float32)}
    if not found.springs:
        kept['springs'] = np.zeros_like(tensors['springs'])
    save_weights(path, tensors | kept, card)
    return found


def _ratio(errors: Array, of_laws: Array) -> tuple[float, float]:
    """Mean over horizons of the ratio of mean errors, and its standard error over tracks."""

    def ratio(kept: Indices) -> float:
        return float(np.mean(errors[kept].mean(axis=0) / of_laws[kept].mean(axis=0)))

    everyone = np.arange(len(errors))
    if not np.isfinite(errors).all():
        return math.inf, 0.0
    left_out = [ratio(np.delete(everyone, k)) for k in everyone]
    spread = math.sqrt((len(everyone) - 1) * float(np.var(left_out)))
    return ratio(everyone), spread
