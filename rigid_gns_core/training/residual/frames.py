# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames to learn from: what the laws made of a state, and what was observed instead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
import torch
from torch import Tensor

from .blows import blows_of, states_after_blows
from .smoothing import smoothed_states
from ...data.records import Record, SAME_STEP
from ...data.tracks import known_rotations
from ...engine.learned_contacts import LearnedContacts
from ...engine.learned_network import LearnedNetwork
from ...engine.learned_stepper import LearnedStepper
from ...engine.options import LawsOptions
from ...errors import UserError
from ...kernels.neighbours import Flags
from ...networks.residual import Bodies, Contacts
from ...prediction.laws import UNITS
from ...rollout.stepper import state_at
from ...scenes.scene import Scene
from ...scenes.similarity import Similarity
from ...scenes.state import Array, stacked, State


@dataclass(frozen=True)
class Track:
    """A record in the model's units: states at all samples, so many of them in a frame.

    completed: the states with blows completed; known: where those are, shape (m, n); turns:
    spheres whose rotation was tracked, shape (n,).
    """

    scene: Scene
    states: State
    samples: int
    completed: State
    known: Flags
    turns: Flags

    @classmethod
    def of(cls, record: Record) -> Track:
        """Track of a record; the states of a tracked one are smoothed.

        Raises:
            UserError: A frame is no whole number of the record's steps, it has too few, or its
                scene has obstacles or surfaces that move.
        """
        scene = record.scene
        moving = any(plane.moves for plane in scene.surfaces)
        if moving or scene.obstacles:
            what = 'surfaces that move' if moving else 'obstacles'
            raise UserError(
                f'record {record.name!r} has {what}, but a residual network sees contacts with '
                'planes at rest and spheres alone; leave such records out'
            )
        similarity = Similarity.between(scene, UNITS)
        frame = UNITS.dt * similarity.time
        samples = round(frame / record.trajectory.dt)
        if samples < 1 or abs(samples * record.trajectory.dt - frame) > SAME_STEP * frame:
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
        h, turns = UNITS.dt / samples, np.ones(states.positions.shape[1], dtype=bool)
        if record.teacher.get('engine') == 'tracker':
            states = smoothed_states(units, states.positions, states.quaternions, h)
            turns = _are_tracked(record.trajectory.quaternions)
        return cls(units, states, samples, *states_after_blows(units, states, h), turns)

    def with_blows(self) -> Track:
        """Track for springs, which follow blows: none is completed, and those are not known."""
        in_blow = blows_of(self.scene, self.states, UNITS.dt / self.samples)
        return replace(self, completed=self.states, known=~in_blow)

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
    """Contacts of a frame, properties of its bodies, and how the laws were off.

    errors: of positions, velocities and spins, shape (n, 9), those of spins that nobody saw being
    0; known: where they are, shape (n,).
    """

    contacts: LearnedContacts
    bodies: Array
    errors: Array
    known: Flags


def _are_tracked(quaternions: Array) -> Flags:
    """Spheres whose rotation is not the same throughout, shape (n,)."""
    known = known_rotations(quaternions)
    if known is None:
        return np.zeros(quaternions.shape[1], dtype=bool)
    return np.asarray(np.isfinite(known).all(axis=(0, 2)))


def frames_from(
    track: Track,
    sample: int,
    frames: int,
    network: LearnedNetwork,
    options: LawsOptions,
    *,
    observed: bool = True,
) -> list[Frame]:
    """Frames of a rollout from a sample of a track; those with contacts of the network.

    It begins at the observed state or, as a rollout of the network does later, after blows.
    """
    start = track.at(sample) if observed else state_at(track.completed, sample)
    stepper = LearnedStepper(
        network, track.scene, start, UNITS.dt, observed=observed, **asdict(options)
    )
    world = stepper.world
    bodies = np.stack([world.radius, world.inverse_mass, world.inverse_inertia])
    made = []
    for frame in range(1, frames + 1):
        one = stepper.frame()
        if not len(one.contacts.a):
            continue
        end = sample + frame * track.samples
        seen = state_at(track.completed, end)
        errors = np.concatenate(
            [
                seen.positions - one.laws.positions,
                seen.velocities - one.laws.velocities,
                seen.angular_velocities - one.laws.angular_velocities,
            ],
            axis=1,
        )
        errors[~track.turns, 6:] = 0.0  # left as the laws have them
        made.append(Frame(one.contacts, bodies, errors, track.known[end]))
    return made


def batch_of(frames: Sequence[Frame]) -> tuple[Contacts, Bodies, Tensor, Tensor]:
    """Contacts, bodies, errors of frames and where they are known, one after the other."""
    counts = [len(frame.errors) for frame in frames]
    contacts = Contacts.of([frame.contacts for frame in frames], counts)
    joined = np.concatenate([frame.bodies[:, :-1] for frame in frames], axis=1)
    joined = np.concatenate([joined, np.zeros((3, 1))], axis=1)  # surfaces
    bodies = Bodies(*torch.as_tensor(joined, dtype=torch.float32))
    errors = np.concatenate([frame.errors for frame in frames])
    known = torch.as_tensor(np.concatenate([frame.known for frame in frames]))
    return contacts, bodies, torch.as_tensor(errors, dtype=torch.float32), known
