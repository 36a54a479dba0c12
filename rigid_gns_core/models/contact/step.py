"""One frame: K substeps of free flight, contacts, impulses and push-out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from .candidates import Candidates
from .geometry import Contacts, find_contacts
from .law import Law
from .memory import Memory, contact_key
from .network import ContactNetwork
from .overlap import push_out
from .solver import Impulses, solve
from .world import UNIT_GRAVITY, World

# passes that mend collisions in paths that contacts bent within the last substep
_CATCHES = 3
# rounds of the law that find the impulses of contacts which last, where none are known yet
_PRIMING = 60

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
) -> tuple[Motion, Memory, Contacts | None]:
    """Advance by `h`; also returns the impulses to start the next one from, and the contacts.

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
    for some, depth, tuner in ((~shared, 1, None), (shared, rounds, network)):
        index = torch.nonzero(some)[:, 0]
        if not len(index):
            continue
        mine = contacts.take(index) if len(index) < len(contacts) else contacts
        start = memory.recall(key[index], p) if depth > 1 else Impulses.zeros(len(index), p)
        solution = solve(Law(world, mine, h, pace), v, w, start, depth, tuner)
        positions = positions + solution.positions
        velocities = velocities + solution.velocities
        spins = spins + solution.angular_velocities
        memory_parts.append((key[index], solution.impulses))
    memory = Memory.of(memory_parts)
    positions = push_out(world, positions, contacts)
    return Motion(positions, velocities, spins, motion.awake), memory, contacts


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
    memory: Memory,
    substeps: int,
    rounds: int,
    network: ContactNetwork | None,
) -> Frame:
    """Advance by `dt` in `substeps` substeps.

    Args:
        world: What does not move.
        motion: State.
        neighbours: Finds candidates from positions and velocities.
        dt: Length of the frame.
        memory: Of the last frame.
        substeps: K.
        rounds: M.
        network: None: the law alone.
    """
    h = dt / substeps
    found: list[Contacts] = []
    turned = []
    start, spent = motion, 0.0
    candidates = neighbours(motion.positions, motion.velocities)
    fall = float(world.gravity.norm()) * dt**2
    reach = start.velocities.detach().norm(dim=1) * dt + fall
    if not len(memory.key) and len(candidates):
        with torch.no_grad():
            _, memory, _ = substep(world, motion, candidates, h, h, memory, _PRIMING, None)
    for index in range(substeps):
        if index and len(candidates):
            # a sphere that was struck may go farther than its candidates reach
            ahead = (motion.positions - start.positions).detach().norm(dim=1)
            ahead = ahead + motion.velocities.detach().norm(dim=1) * (dt - spent)
            if bool((ahead > reach * 1.001 + 1e-3).any()):
                candidates = neighbours(motion.positions, motion.velocities)
                start = motion
                reach = start.velocities.detach().norm(dim=1) * dt + fall
        motion, memory, contacts = substep(world, motion, candidates, h, h, memory, rounds, network)
        spent += h
        turned.append(motion.angular_velocities * h)
        if contacts is not None:
            found.append(contacts)
    for _ in range(_CATCHES):
        missed = _missed(world, motion, candidates, h)
        if missed is None:
            break
        motion, _, contacts = substep(
            world, motion, missed, 0.0, h, Memory.empty(motion.positions), rounds, network
        )
        if contacts is not None:
            found.append(contacts)
    return Frame(motion, memory, found, torch.stack(turned))


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
    pairs = hit[candidates.first] | hit[candidates.second]
    others = hit[candidates.sphere]
    return Candidates(
        candidates.first[pairs],
        candidates.second[pairs],
        candidates.sphere[others],
        candidates.plane[others],
    )
