# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames to learn from: what the laws made of a state, and what was observed instead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
import torch
from torch import Tensor

from .smoothing import smoothed_states
from ...data.records import Record
from ...engine.learned_contacts import LearnedContacts
from ...engine.learned_network import LearnedNetwork
from ...engine.learned_stepper import LearnedStepper
from ...engine.options import LawsOptions
from ...errors import UserError
from ...networks.residual import Bodies, Contacts
from ...prediction.laws import UNITS
from ...rollout.stepper import state_at
from ...scenes.scene import Scene
from ...scenes.similarity import Similarity
from ...scenes.state import Array, stacked, State

# relative difference up to which a time step counts as a part of a frame
_SAME_STEP = 1e-3


@dataclass(frozen=True)
class Track:
    """A record in the model's units: states at all samples, so many of them in a frame."""

    scene: Scene
    states: State
    samples: int

    @classmethod
    def of(cls, record: Record) -> Track:
        """Track of a record; the states of a tracked one are smoothed.

        Raises:
            UserError: A frame is no whole number of the record's steps, or it has too few.
        """
        scene = record.scene
        similarity = Similarity.between(scene, UNITS)
        frame = UNITS.dt * similarity.time
        samples = round(frame / record.trajectory.dt)
        if samples < 1 or abs(samples * record.trajectory.dt - frame) > _SAME_STEP * frame:
            raise UserError(
                f'record {record.name!r} has a time step of {record.trajectory.dt:.4g} s, but a '
                f'frame of {frame:.4g} s for its radius and gravity should be one or several of '
                'them; import or generate it with such a step'
            )
        steps = record.trajectory.steps
        if steps < max(samples, 4):
            raise UserError(
                f'record {record.name!r} has {steps} steps, expected {max(samples, 4)} or more'
            )
        states = stacked([similarity.to_model(state) for state in record.trajectory])
        units = similarity.scene(scene)
        if record.teacher.get('engine') == 'tracker':
            h = UNITS.dt / samples
            states = smoothed_states(units, states.positions, states.quaternions, h)
        return cls(units, states, samples)

    def at(self, sample: int) -> State:
        """State at a sample."""
        return state_at(self.states, sample)

    def last_start(self, frames: int) -> int:
        """Last sample from which so many frames are within the track; negative: none."""
        return len(self.states.positions) - 1 - frames * self.samples

    def stride(self, starts: int) -> int:
        """Samples between starts, for so many in a frame."""
        return max(1, self.samples // starts)


@dataclass(frozen=True)
class Frame:
    """Contacts of a frame, properties of its bodies, and how the laws were off, shape (n, 9)."""

    contacts: LearnedContacts
    bodies: Array
    errors: Array


def frames_from(
    track: Track, sample: int, frames: int, network: LearnedNetwork, options: LawsOptions
) -> list[Frame]:
    """Frames of a rollout from a sample of a track; those with contacts of the network."""
    stepper = LearnedStepper(network, track.scene, track.at(sample), UNITS.dt, **asdict(options))
    world = stepper.world
    bodies = np.stack([world.radius, world.inverse_mass, world.inverse_inertia])
    made = []
    for frame in range(1, frames + 1):
        one = stepper.frame()
        if not len(one.contacts.a):
            continue
        seen = track.at(sample + frame * track.samples)
        errors = np.concatenate(
            [
                seen.positions - one.laws.positions,
                seen.velocities - one.laws.velocities,
                seen.angular_velocities - one.laws.angular_velocities,
            ],
            axis=1,
        )
        made.append(Frame(one.contacts, bodies, errors))
    return made


def batch_of(frames: Sequence[Frame]) -> tuple[Contacts, Bodies, Tensor]:
    """Contacts, bodies and errors of frames, one after the other."""
    counts = [len(frame.errors) for frame in frames]
    contacts = Contacts.of([frame.contacts for frame in frames], counts)
    joined = np.concatenate([frame.bodies[:, :-1] for frame in frames], axis=1)
    joined = np.concatenate([joined, np.zeros((3, 1))], axis=1)  # surfaces
    bodies = Bodies(*torch.as_tensor(joined, dtype=torch.float32))
    errors = np.concatenate([frame.errors for frame in frames])
    return contacts, bodies, torch.as_tensor(errors, dtype=torch.float32)
