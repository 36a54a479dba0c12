# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training of the residual network: one frame of the laws at a time against the observed one.

Half of the frames begin at observed states, half at those after the blows that a sample is in the
middle of (`blows.py`), which all of them end at; and some at states that a rollout with the
network itself leads to (pushforward), so that it meets its own errors. No gradient passes the
solver.

The loss of a sphere is p |x| + |v| + s r |w|, with x, v and w what is left of its errors: of their
sizes, not their squares, since a missed collision must not count as much as many small errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from .frames import batch_of, Frame, frames_from, Track
from .springs import fit_springs
from .stiffness import stiffness_of
from ..learner import Learner, Schedule
from ...data.records import Record
from ...engine.learned_network import network_of
from ...engine.options import LawsOptions, ResidualConfig
from ...errors import UserError
from ...files.checkpoint import tensors_of
from ...files.config import check_least, check_positive
from ...networks.residual import changes, ResidualNetwork
from ...prediction.laws import UNITS

# frames whose statistics normalise features
_STATISTICS = 500
# errors of position [radii of 1 m] from which on a sphere has met other contacts than observed
_LOST = 0.6
# errors below which the loss is quadratic [m, m/s, rad/s]
_SMALL = (3e-3, 3e-2, 5e-2)


class NothingToLearnError(UserError):
    """No frame of the training data has what a residual network acts on."""


@dataclass(frozen=True)
class ResidualTrainConfig(Schedule):
    """A training recipe of the residual network; config/train/residual.yaml explains each choice.

    Args:
        model: The network.
        position_weight: p [1/s].
        spin_weight: s.
        starts: Frames of the laws that begin within each frame of a track, where it has as many
            samples.
        spring_windows: Starts that the springs of blows are fitted to; 0: no springs.
        pushforward_frames: Length of the network's own rollouts; 0: none.
        pushforward_starts: Rollouts of a round.
        pushforward_rounds: Rounds; the first after an equal share of the steps.
    """

    model: ResidualConfig = field(default_factory=ResidualConfig)
    position_weight: float = 8.0
    spin_weight: float = 0.15
    starts: int = 2
    spring_windows: int = 80
    pushforward_frames: int = 4
    pushforward_starts: int = 1000
    pushforward_rounds: int = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        check_least(self, 0, 'spin_weight', 'spring_windows', 'pushforward_frames')
        check_least(self, 0, 'pushforward_rounds')
        check_least(self, 1, 'starts', 'pushforward_starts')
        check_positive(self, 'position_weight')


class ResidualLearner(Learner[ResidualNetwork]):
    """Trains a residual network.

    Args:
        config: The recipe.
        tracks: What was observed.
        materials: What the card says of the materials.
    """

    kind = 'residual'
    measure = 'position_error_radii'
    config: ResidualTrainConfig

    def __init__(
        self,
        config: ResidualTrainConfig,
        tracks: Sequence[Track],
        materials: dict[str, float] | None = None,
    ) -> None:
        torch.manual_seed(config.seed)
        super().__init__(
            config,
            ResidualNetwork(config.model),
            model=config.model,
            units=UNITS,
            materials=materials or {},
            trajectories=len(tracks),
        )
        self.tracks, self.options = list(tracks), LawsOptions()
        springs = fit_springs(tracks, config.spring_windows, config.seed)
        stiffness = springs[0] or stiffness_of(tracks)
        self.network.springs.copy_(torch.as_tensor(springs))
        self.network.stiffness.fill_(stiffness)
        if springs[0] > 0:
            self.tracks = [track.with_blows() for track in tracks]
        self._starts = [
            (t, sample)
            for t, track in enumerate(tracks)
            for sample in range(0, track.last_start(1) + 1, track.stride(config.starts))
        ]
        self._frames = self._collected([(t, sample, 1) for t, sample in self._starts[::2]])
        later = [(t, sample, 1) for t, sample in self._starts[1::2]]
        self._frames += self._collected(later, observed=False)
        if not self._frames:
            raise NothingToLearnError(
                'no frame of the training data has a contact; there is nothing to learn'
            )
        self._fit_normaliser()
        self._own: list[Frame] = []
        self._own_weights: dict[str, Tensor] = {}
        self._round = 0

    @classmethod
    def of(cls, config: ResidualTrainConfig, records: Sequence[Record]) -> ResidualLearner:
        """Learner on records.

        Raises:
            UserError: There are no records, or their steps do not fit; see `Track.of`.
        """
        if not records:
            raise UserError('there are no training trajectories; import or generate some first')
        scene = records[0].scene
        values = ('restitution', 'friction', 'rolling_friction')
        materials = {name: float(np.mean(getattr(scene, name))) for name in values}
        return cls(config, [Track.of(record) for record in records], materials)

    def loss_at(self, step: int) -> Tensor:
        """Loss over the frames of a step: a resumed run draws the same."""
        self._push_forward(step)
        rng = np.random.default_rng([self.config.seed, step])
        pool, size = self._frames + self._own, self.config.batch
        return self.loss([pool[k] for k in rng.integers(0, len(pool), size)])

    def loss(self, frames: Sequence[Frame]) -> Tensor:
        """Loss of frames, a mean over their spheres in contacts."""
        contacts, bodies, errors, known = batch_of(frames)
        moved = changes(self.network(contacts), contacts, bodies, self.units.dt)
        left = errors - torch.cat(moved, dim=1)
        weights = self.config.position_weight, 1.0, self.config.spin_weight
        total = torch.zeros(len(left))
        for part, weight, small in zip(left.split(3, dim=1), weights, _SMALL, strict=True):
            total = total + weight * (part.square().sum(1) + small**2).sqrt()
        in_contact = torch.zeros(len(left) + 1, dtype=torch.bool)
        in_contact[contacts.a] = in_contact[contacts.b] = True
        counted = known & in_contact[:-1] & (errors[:, :3].square().sum(1) < _LOST**2)
        return (total * counted).sum() / counted.sum().clamp(min=1)

    def state(self) -> dict[str, Tensor]:
        """All that a resumed run needs, as tensors on the CPU."""
        own = {f'own.{name}': value for name, value in self._own_weights.items()}
        return super().state() | own | {'round': torch.tensor(self._round)}

    def load_state(self, tensors: dict[str, Tensor]) -> None:
        """Restore what `state` returned."""
        super().load_state(tensors)
        self._round = int(tensors['round'])
        self._own_weights = {
            name.removeprefix('own.'): value
            for name, value in tensors.items()
            if name.startswith('own.')
        }
        if self._own_weights:
            self._own = self._rolled_out()

    def _push_forward(self, step: int) -> None:
        config = self.config
        rounds = config.pushforward_rounds if config.pushforward_frames else 0
        current = step * (rounds + 1) // config.steps
        if current <= self._round:
            return
        self._round = current
        state = self.network.state_dict()
        self._own_weights = {name: value.clone() for name, value in state.items()}
        self._own = self._rolled_out()

    def _rolled_out(self) -> list[Frame]:
        """Frames of rollouts with the weights of the last round."""
        config = self.config
        long = [
            (t, sample)
            for t, sample in self._starts
            if sample <= self.tracks[t].last_start(config.pushforward_frames)
        ]
        if not long:
            raise UserError(
                f'no trajectory has {config.pushforward_frames} frames (pushforward_frames); '
                'lower it, or give longer ones'
            )
        rng = np.random.default_rng([config.seed, self._round, 1])
        chosen = [long[k] for k in rng.integers(0, len(long), config.pushforward_starts)]
        weights = {name: value.numpy() for name, value in self._own_weights.items()}
        return self._collected(
            [(t, sample, config.pushforward_frames) for t, sample in chosen], weights
        )

    def _collected(
        self,
        starts: Sequence[tuple[int, int, int]],
        weights: dict[str, np.ndarray] | None = None,
        *,
        observed: bool = True,
    ) -> list[Frame]:
        network = network_of(weights or tensors_of(self.network), self.config.model)
        made: list[Frame] = []
        for t, sample, frames in starts:
            made += frames_from(
                self.tracks[t], sample, frames, network, self.options, observed=observed
            )
        return made

    def _fit_normaliser(self) -> None:
        rng = np.random.default_rng([self.config.seed, 2])
        chosen = rng.permutation(len(self._frames))[:_STATISTICS]
        features = batch_of([self._frames[k] for k in chosen])[0].features
        self.network.mean.copy_(features.mean(0))
        self.network.deviation.copy_(features.std(0) + 1e-3)
        seen = [batch_of([frame])[0].features for frame in self._frames]
        self.network.low.copy_(torch.stack([one.amin(0) for one in seen]).amin(0))
        self.network.high.copy_(torch.stack([one.amax(0) for one in seen]).amax(0))
