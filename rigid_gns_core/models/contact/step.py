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

"""One frame: K substeps of free flight, contacts, impulses and push-out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import torch
from torch import Tensor

from .candidates import Candidates
from .geometry import Contacts, find_contacts
from .impulses import Impulses
from .islands import Islands
from .law import Law
from .memory import contact_key, Memory
from .network import ContactNetwork
from .overlap import push_out
from .solver import Solution, solve
from .world import UNIT_GRAVITY, World

# passes that mend collisions in paths that contacts bent within the last substep
_CATCHES = 3
# rounds of the law that find the impulses of contacts which last, where none are known yet
_PRIMING = 60
# islands whose last round still changed a contact by this part of g h get so many more of the law,
# or fewer where they change all by less than that part of it
_UNSETTLED, _MORE, _SETTLED = 1.0, 24, 0.1

Neighbours = Callable[[Tensor, Tensor], Candidates]


@dataclass(frozen=True)
class Motion:
    """Moving state as tensors; positions, velocities, angular_velocities (n, 3).

    awake: 0 for spheres that sleep, which nothing pulls, shape (n, 1); None: all are awake.
    """

    positions: Tensor
    velocities: Tensor
    angular_velocities: Tensor
    awake: Tensor | None = None


class Frame(NamedTuple):
    """Result of a frame.

    motion, memory: at its end; contacts: of each substep that had any; turns: rotation vector of
    each sphere in each substep, shape (substeps, n, 3).
    """

    motion: Motion
    memory: Memory
    contacts: list[Contacts]
    turns: Tensor


def substep(
    world: World,
    motion: Motion,
    candidates: Candidates,
    h: float,
    pace: float,
    memory: Memory,
    rounds: int,
    network: ContactNetwork | None,
    settle: bool = True,
) -> tuple[Motion, Memory, Contacts | None]:
    """Advance by `h`; also returns the impulses to start the next one from, and what touched.

    `pace` is the length of a substep as such, to which speeds are compared, where `h` is 0.
    """
    p, v, w = motion.positions, motion.velocities, motion.angular_velocities
    pull = world.gravity if motion.awake is None else motion.awake * world.gravity
    flight = p + h * v + 0.5 * h**2 * pull
    falling = v + h * pull
    none = Motion(flight, falling, w, motion.awake), Memory.empty(p), None
    if not len(candidates):
        return none
    with torch.no_grad():  # where and when bodies meet is taken as given
        contacts = find_contacts(world, p, v, candidates, h, pace)
    if not len(contacts):
        return none
    key = contact_key(world, contacts)
    # contacts that share no body with another need neither network nor rounds
    shared = _shared(world, contacts)
    positions, velocities, spins = flight, falling, w
    memory_parts = []
    real = contacts.open == 0
    for some, depth, tuner in ((~shared, 1, None), (shared, rounds, network)):
        index = torch.nonzero(some)[:, 0]
        if not len(index):
            continue
        mine = contacts.take(index) if len(index) < len(contacts) else contacts
        start = memory.recall(key[index], p) if depth > 1 else Impulses.zeros(len(index), p)
        solution = solve(Law(world, mine, h, pace), v, w, start, depth, tuner)
        if depth > 1 and settle:
            solution = _settle(world, mine, h, pace, motion, start, solution)
        positions = positions + solution.positions
        velocities = velocities + solution.velocities
        spins = spins + solution.angular_velocities
        memory_parts.append((key[index], solution.impulses))
        real[index] |= solution.impulses.normal > 0
    memory = Memory.of(memory_parts)
    positions = push_out(world, positions, contacts)
    touching = contacts.take(torch.nonzero(real)[:, 0])
    return Motion(positions, velocities, spins, motion.awake), memory, touching


def _settle(
    world: World,
    contacts: Contacts,
    h: float,
    pace: float,
    motion: Motion,
    support: Impulses,
    solution: Solution,
) -> Solution:
    """More rounds of the law for islands that a blow has left far from its end.

    Island by island, so that none feels what happens elsewhere.
    """
    loud = solution.unsettled > _UNSETTLED * UNIT_GRAVITY * pace
    if not bool(loud.any()):
        return solution
    island = torch.from_numpy(Islands.of([contacts], world.count).label)[contacts.a]
    enough = _SETTLED * UNIT_GRAVITY * pace
    for label in torch.unique(island[loud]):
        again = torch.nonzero(island == label)[:, 0]
        mine = contacts.take(again)
        start, held = solution.impulses.take(again), support.take(again)
        more = solve(
            Law(world, mine, h, pace),
            motion.velocities,
            motion.angular_velocities,
            start,
            _MORE,
            None,
            held,
            enough,
        )
        solution = _with_island(solution, again, mine, more, world.count)
    return solution


def _with_island(
    solution: Solution, index: Tensor, contacts: Contacts, more: Solution, count: int
) -> Solution:
    """Return the solution with that of one island instead."""
    bodies = torch.zeros(count + 1, dtype=torch.bool)
    bodies[contacts.a] = True
    bodies[contacts.b] = True
    mine, old, new = bodies[:-1, None], solution.impulses, more.impulses
    impulses = Impulses(
        old.normal.index_copy(0, index, new.normal),
        old.tangential.index_copy(0, index, new.tangential),
        old.rolling.index_copy(0, index, new.rolling),
    )
    return Solution(
        impulses,
        torch.where(mine, more.velocities, solution.velocities),
        torch.where(mine, more.angular_velocities, solution.angular_velocities),
        torch.where(mine, more.positions, solution.positions),
        solution.unsettled,
    )


def _shared(world: World, contacts: Contacts) -> Tensor:
    """Whether another contact has one of the same moving bodies, shape (c,)."""
    load = torch.bincount(torch.cat([contacts.a, contacts.b]), minlength=world.count + 1)
    load[-1] = 0
    return (load[contacts.a] > 1) | (load[contacts.b] > 1)


def frame(
    world: World,
    motion: Motion,
    neighbours: Neighbours,
    dt: float,
    memory: Memory | None,
    substeps: int,
    rounds: int,
    network: ContactNetwork | None,
    settle: bool = True,
) -> Frame:
    """Advance by `dt` in `substeps` substeps.

    Args:
        world: What does not move.
        motion: State.
        neighbours: Finds candidates from positions and velocities.
        dt: Length of the frame.
        memory: Of the last frame; None at a start, where it is found first.
        substeps: K.
        rounds: M.
        network: None: the law alone.
        settle: More rounds after a blow; training goes without, so that the M rounds learn.
    """
    h = dt / substeps
    found: list[Contacts] = []
    turned = []
    near = _Near(world, neighbours, motion, dt)
    if memory is None:
        memory = Memory.empty(motion.positions)
        with torch.no_grad():
            _, memory, _ = substep(world, motion, near.candidates, h, h, memory, _PRIMING, None)
    for index in range(substeps):
        near.follow(motion, dt - index * h)
        motion, memory, contacts = substep(
            world, motion, near.candidates, h, h, memory, rounds, network, settle
        )
        turned.append(motion.angular_velocities * h)
        if contacts is not None:
            found.append(contacts)
    for _ in range(_CATCHES):
        near.follow(motion, 0.0)
        missed = _missed(world, motion, near.candidates, h)
        if missed is None:
            break
        motion, _, contacts = substep(
            world, motion, missed, 0.0, h, Memory.empty(motion.positions), rounds, network
        )
        if contacts is not None:
            found.append(contacts)
            motion = _apart(world, motion, near.candidates)
    return Frame(motion, memory, found, torch.stack(turned))


class _Near:
    """Candidates of a frame, found anew where a sphere that was struck outran them."""

    def __init__(self, world: World, neighbours: Neighbours, motion: Motion, dt: float) -> None:
        self.neighbours, self.dt = neighbours, dt
        self.fall = float(world.gravity.norm()) * dt**2
        self._find(motion)

    def follow(self, motion: Motion, left: float) -> None:
        """Before a substep, with `left` of the frame to go."""
        gone = (motion.positions - self.start).detach().norm(dim=1)
        ahead = gone + motion.velocities.detach().norm(dim=1) * left
        if bool((ahead > self.reach * 1.001 + 1e-3).any()):
            self._find(motion)

    def _find(self, motion: Motion) -> None:
        self.candidates = self.neighbours(motion.positions, motion.velocities)
        self.start = motion.positions.detach()
        self.reach = motion.velocities.detach().norm(dim=1) * self.dt + self.fall


def _apart(world: World, motion: Motion, candidates: Candidates) -> Motion:
    """Without overlaps with bodies that had no contact in the catch: one may be between two."""
    with torch.no_grad():
        contacts = find_contacts(world, motion.positions, motion.velocities, candidates, 0.0, 0.0)
    return replace(motion, positions=push_out(world, motion.positions, contacts))


def _missed(world: World, motion: Motion, candidates: Candidates, h: float) -> Candidates | None:
    """Candidates around bodies that overlap and approach, met by paths that contacts bent."""
    if not len(candidates):
        return None
    with torch.no_grad():
        contacts = find_contacts(world, motion.positions, motion.velocities, candidates, 0.0, h)
        quiet = UNIT_GRAVITY * h
        late = (contacts.time < 0) & (contacts.approach > quiet)
        if not bool(late.any()):
            return None
        hit = torch.zeros(world.count + 1, dtype=torch.bool)
        hit[contacts.a[late]] = True
        hit[contacts.b[late]] = True
        hit[-1] = False
        hit = hit.numpy()
    return candidates.around(hit)
