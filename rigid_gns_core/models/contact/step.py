"""One frame: K substeps of free flight, contacts, impulses and push-out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from . import geometry
from .candidates import Candidates
from .geometry import Contacts
from .network import ContactNetwork
from .solver import Impulses, Law, solve
from .world import UNIT_GRAVITY, World

# sweeps that push out what still overlaps at the end of a substep
_SWEEPS = 4
# passes that mend collisions in paths that contacts bent within the last substep
_CATCHES = 3

Neighbours = Callable[[Tensor, Tensor], Candidates]


@dataclass(frozen=True)
class Motion:
    """Moving state as tensors; positions, velocities, angular_velocities (n, 3)."""

    positions: Tensor
    velocities: Tensor
    angular_velocities: Tensor


@dataclass(frozen=True)
class Memory:
    """Impulses per time of contacts that persist, by key, sorted; nothing at the start.

    key: shape (c,); impulses: see there.
    """

    key: Tensor
    impulses: Impulses

    @classmethod
    def empty(cls, like: Tensor) -> Memory:
        """No contacts."""
        return cls(torch.zeros(0, dtype=torch.int64), Impulses.zeros(0, like))

    def recall(self, key: Tensor, like: Tensor) -> Impulses:
        """Impulses of these contacts, zero where they are new."""
        if not len(self.key) or not len(key):
            return Impulses.zeros(len(key), like)
        place = torch.searchsorted(self.key, key).clamp(max=len(self.key) - 1)
        known = (self.key[place] == key).to(like.dtype)
        old = self.impulses
        return Impulses(
            old.normal[place] * known,
            old.tangential[place] * known[:, None],
            old.rolling[place] * known[:, None],
        )


def contact_key(world: World, contacts: Contacts) -> Tensor:
    """A number for each pair of bodies, shape (c,)."""
    bodies = world.count + len(world.point)
    other = torch.where(contacts.plane >= 0, world.count + contacts.plane, contacts.b)
    return contacts.a * bodies + other


def find_contacts(world: World, motion: Motion, candidates: Candidates, h: float, past: float) -> Contacts:
    """Contacts of the next substep, of spheres with spheres and with surfaces."""
    positions, velocities = motion.positions, motion.velocities
    parts = []
    if len(candidates.first):
        parts.append(
            geometry.sphere_contacts(
                world,
                positions,
                velocities,
                torch.from_numpy(candidates.first),
                torch.from_numpy(candidates.second),
                h,
                past,
            )
        )
    if len(candidates.sphere):
        parts.append(
            geometry.surface_contacts(
                world,
                positions,
                velocities,
                torch.from_numpy(candidates.sphere),
                torch.from_numpy(candidates.plane),
                h,
                past,
            )
        )
    return geometry.join(parts)


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
    flight = p + h * v + 0.5 * h**2 * world.gravity
    falling = v + h * world.gravity
    none = Motion(flight, falling, w), Memory.empty(p), None
    if not len(candidates):
        return none
    with torch.no_grad():  # where and when bodies meet is taken as given
        contacts = find_contacts(world, motion, candidates, h, pace)
    if not len(contacts):
        return none
    key = contact_key(world, contacts)
    law = Law(world, contacts, h, pace)
    solution = solve(law, v, w, memory.recall(key, p), rounds, network)
    positions = push_out(world, flight + solution.positions, contacts)
    order = torch.argsort(key)
    impulses = solution.impulses
    memory = Memory(
        key[order],
        Impulses(impulses.normal[order], impulses.tangential[order], impulses.rolling[order]),
    )
    moved = Motion(
        positions, falling + solution.velocities, w + solution.angular_velocities
    )
    return moved, memory, contacts


def push_out(world: World, positions: Tensor, contacts: Contacts) -> Tensor:
    """Move overlapping bodies apart along their normals, the centre of mass of a pair kept."""
    a, b = contacts.a, contacts.b
    inverse = world.inverse_mass
    for _ in range(_SWEEPS):
        with torch.no_grad():
            gap, normal = geometry.gaps(world, positions, contacts)
            deep = gap < 0
        if not bool(deep.any()):
            break
        touched = torch.nonzero(deep)[:, 0]
        one, other = a[touched], b[touched]
        load = torch.zeros_like(inverse)
        unit = torch.ones(len(touched), dtype=inverse.dtype)
        load = load.index_add(0, one, unit).index_add(0, other, unit)
        load = torch.cat([load[:-1], load.new_ones(1)])
        share = -gap[touched] / (load[one] * inverse[one] + load[other] * inverse[other])
        push = share[:, None] * normal[touched]
        shift = positions.new_zeros(world.count + 1, 3)
        shift = shift.index_add(0, one, push * inverse[one][:, None])
        shift = shift.index_add(0, other, push * -inverse[other][:, None])
        positions = positions + shift[:-1]
    return positions


def frame(
    world: World,
    motion: Motion,
    neighbours: Neighbours,
    dt: float,
    memory: Memory,
    substeps: int,
    rounds: int,
    network: ContactNetwork | None,
) -> tuple[Motion, Memory, list[Contacts], Tensor]:
    """Advance by `dt` in `substeps` substeps.

    Args:
        world: What does not move.
        motion: State.
        neighbours: Finds candidates from positions and velocities.
        dt: Length of the frame.
        memory: Of the last frame.
        substeps, rounds: K and M.
        network: None: the law alone.

    Returns:
        State, memory, contacts of each substep that had any, and the angle each sphere has turned
        by as rotation vectors, shape (n, 3, substeps) summed where the axis stays.
    """
    h = dt / substeps
    found: list[Contacts] = []
    turned = []
    start, spent = motion, 0.0
    candidates = neighbours(motion.positions, motion.velocities)
    fall = float(world.gravity.norm()) * dt**2
    reach = start.velocities.detach().norm(dim=1) * dt + fall
    for index in range(substeps):
        if index and len(candidates):
            # a sphere that was struck may go farther than its candidates reach
            ahead = (motion.positions - start.positions).detach().norm(dim=1)
            ahead = ahead + motion.velocities.detach().norm(dim=1) * (dt - spent)
            if bool((ahead > reach * 1.001 + 1e-3).any()):
                candidates = neighbours(motion.positions, motion.velocities)
                start = motion
                reach = start.velocities.detach().norm(dim=1) * dt + fall
        motion, memory, contacts = substep(
            world, motion, candidates, h, h, memory, rounds, network
        )
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
    return motion, memory, found, torch.stack(turned)


def _missed(world: World, motion: Motion, candidates: Candidates, h: float) -> Candidates | None:
    """Candidates around bodies that overlap and approach, met by paths that contacts bent."""
    if not len(candidates):
        return None
    with torch.no_grad():
        contacts = find_contacts(world, motion, candidates, 0.0, h)
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
        candidates.first[pairs], candidates.second[pairs],
        candidates.sphere[others], candidates.plane[others],
    )


