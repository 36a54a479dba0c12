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

"""When, where and along which normal bodies meet within a substep, on their free paths."""

from __future__ import annotations

from dataclasses import dataclass, fields

import torch
from torch import Tensor

from .candidates import Candidates
from .world import World

# bodies nearer than this times the smaller radius count as touching
TOUCH = 2e-4


@dataclass(frozen=True)
class Contacts:
    """Contacts of one substep; c of them. The normal points from body b to body a.

    Args:
        a, b: Bodies; b is the fixed one (n) for surfaces, shape (c,).
        plane: Number of the plane, -1 for two spheres, shape (c,).
        side: Side of the plane that the sphere is on, 1 or -1; 0 for two spheres, shape (c,).
        normal: Unit normal at the time of impact, shape (c, 3).
        time: Time of impact from the start of the substep; negative where the bodies overlap and
            should have met before, shape (c,).
        gap: Gap between the surfaces at that time, shape (c,).
        open: The same for bodies that their free paths do not bring together, but that are so near
            that other contacts may; their time is 0. Else 0, shape (c,).
        approach: Speed at which they approach then, negative where they part, shape (c,).
        pull: Relative acceleration of the free paths along the normal, shape (c,).
    """

    a: Tensor
    b: Tensor
    plane: Tensor
    side: Tensor
    normal: Tensor
    time: Tensor
    gap: Tensor
    open: Tensor
    approach: Tensor
    pull: Tensor

    def __len__(self) -> int:
        return len(self.a)

    def take(self, index: Tensor) -> Contacts:
        """Those of `index` (numbers or a mask)."""
        return Contacts(*(getattr(self, field.name)[index] for field in fields(self)))


def sphere_contacts(
    world: World,
    positions: Tensor,
    velocities: Tensor,
    first: Tensor,
    second: Tensor,
    h: float,
    past: float,
    near: float,
) -> Contacts:
    """Pairs that touch or meet within `h`; relative motion of free paths is straight.

    Pairs that overlap should have met before, up to `past` ago; those with a gap below `near` are
    kept in view.

    The time of impact is the first root of |x + u t| = R, exact for spheres.

    Args:
        world: What does not move.
        positions: Centres, shape (n, 3).
        velocities: Shape (n, 3).
        first: One sphere of each pair, shape (pairs,).
        second: The other, shape (pairs,).
        h: Length of the substep.
        past: Time before it.
        near: Gap.
    """
    offset = positions[first] - positions[second]
    moving = velocities[first] - velocities[second]
    touching = world.radius[first] + world.radius[second]
    distance = offset.norm(dim=1)
    gap = distance - touching
    along = (offset * moving).sum(1)
    square = moving.square().sum(1)
    discriminant = along.square() - square * gap * (distance + touching)
    hits = (gap > 0) & (along < 0) & (discriminant >= 0)
    ahead = (
        gap * (distance + touching) / (discriminant.clamp(min=0).sqrt() - along).clamp(min=1e-30)
    )
    hits &= ahead <= h
    smaller = torch.minimum(world.radius[first], world.radius[second])
    touches = gap <= TOUCH * smaller
    active = torch.nonzero(hits | touches | (gap <= near))[:, 0]
    offset, moving, distance = offset[active], moving[active], distance[active]
    gap, along, ahead, hits = gap[active], along[active], ahead[active], hits[active]
    apart = torch.where(hits | touches[active], 0.0, gap)
    speed = -along / distance.clamp(min=1e-30)
    late = torch.where(speed > 0, (gap / speed.clamp(min=1e-30)).clamp(-past, past), 0.0)
    time = torch.where(hits, ahead, late.clamp(max=0.0))
    meeting = offset + time.clamp(min=0)[:, None] * moving
    length = meeting.norm(dim=1, keepdim=True)
    up = torch.zeros_like(meeting)
    up[:, 2] = 1.0
    normal = torch.where(length > 1e-9, meeting / length.clamp(min=1e-30), up)
    approach = -(normal * moving).sum(1)
    return Contacts(
        a=first[active],
        b=second[active],
        plane=torch.full_like(active, -1),
        side=torch.zeros_like(approach),
        normal=normal,
        time=time,
        gap=length[:, 0] - touching[active],
        open=apart,
        approach=approach,
        pull=torch.zeros_like(approach),
    )


def surface_contacts(
    world: World,
    positions: Tensor,
    velocities: Tensor,
    sphere: Tensor,
    plane: Tensor,
    side: Tensor,
    h: float,
    past: float,
    near: float,
) -> Contacts:
    """Spheres that touch or meet a bounded plane within `h`, on parabolas.

    A plane with an infinite side is the boundary of a body: spheres are in front of it, however
    deep. One with an end on all sides is a plate that has two faces. Its edge is met at the end of
    the path, to first order.

    Args:
        world: What does not move.
        positions: Centres, shape (n, 3).
        velocities: Shape (n, 3).
        sphere: One of each pair, shape (others,).
        plane: The other, shape (others,).
        side: Of the plane; see `Candidates`, shape (others,).
        h: As for spheres.
        past: As for spheres.
        near: As for spheres.
    """
    axes, radius = world.axes[plane], world.radius[sphere]
    local = torch.einsum('cij,cj->ci', axes, positions[sphere] - world.point[plane])
    moving = torch.einsum('cij,cj->ci', axes, velocities[sphere])
    pulling = torch.einsum('cij,j->ci', axes, world.gravity)
    half = world.half[plane]
    height, speed, pull = side * local[:, 2], side * moving[:, 2], side * pulling[:, 2]
    gap = height - radius
    discriminant = speed.square() - 2.0 * pull * gap
    denominator = discriminant.clamp(min=0).sqrt() - speed
    ahead = 2.0 * gap / denominator.clamp(min=1e-30)
    hits = (gap > 0) & (discriminant >= 0) & (denominator > 0) & (ahead <= h)
    touches = gap <= TOUCH * radius
    late = torch.where(speed < 0, (gap / (-speed).clamp(min=1e-30)).clamp(-past, past), 0.0)
    time = torch.where(hits, ahead, late.clamp(max=0.0))
    before = time.clamp(min=0)[:, None]
    there = local + before * (moving + 0.5 * before * pulling)
    face = (there[:, :2].abs() <= half).all(1) & (hits | touches | (gap <= near))

    # edges: closest points at the start and at the end of the free path
    rim = _outside(local, half)
    end = local + h * moving + 0.5 * h**2 * pulling
    rim_end = _outside(end, half)
    rim_gap, rim_gap_end = rim.norm(dim=1) - radius, rim_end.norm(dim=1) - radius
    edge = ~face & ((rim_gap <= max(near, TOUCH)) | (rim_gap_end < 0))
    edge &= (rim[:, :2] != 0).any(1) | (rim_end[:, :2] != 0).any(1)
    apart = torch.where(face, (hits | touches).logical_not() * gap, (rim_gap_end >= 0) * rim_gap)
    apart = torch.where(apart > TOUCH * radius, apart, 0.0)
    share = (rim_gap / (rim_gap - rim_gap_end).clamp(min=1e-30)).clamp(0.0, 1.0)
    edge_time = torch.where((rim_gap > 0) & (rim_gap_end < 0), share * h, 0.0)

    active = torch.nonzero(face | edge)[:, 0]
    on_face = face[active][:, None]
    axes, local, moving, pulling = axes[active], local[active], moving[active], pulling[active]
    when = torch.where(on_face[:, 0], time[active], edge_time[active])
    ahead = when.clamp(min=0)[:, None]
    at = local + ahead * (moving + 0.5 * ahead * pulling)
    from_rim = _outside(at, half[active])
    rim_length = from_rim.norm(dim=1, keepdim=True).clamp(min=1e-30)
    straight = torch.zeros_like(local)
    straight[:, 2] = side[active]
    normal = torch.where(on_face, straight, from_rim / rim_length)
    distance = torch.where(on_face[:, 0], side[active] * at[:, 2], rim_length[:, 0])
    velocity = moving + ahead * pulling
    return Contacts(
        a=sphere[active],
        b=torch.full_like(active, world.count),
        plane=plane[active],
        side=side[active],
        normal=torch.einsum('cij,ci->cj', axes, normal),
        time=when,
        gap=distance - radius[active],
        open=apart[active],
        approach=-(velocity * normal).sum(1),
        pull=(pulling * normal).sum(1),
    )


def find_contacts(
    world: World,
    positions: Tensor,
    velocities: Tensor,
    candidates: Candidates,
    h: float,
    past: float,
) -> Contacts:
    """Contacts of the next substep, of spheres with spheres and with surfaces.

    Positions and velocities have shape (n, 3); `past`: see `sphere_contacts`.
    """
    near = float(world.gravity.norm()) * h**2
    parts = []
    if len(candidates.first):
        parts.append(
            sphere_contacts(
                world,
                positions,
                velocities,
                torch.from_numpy(candidates.first),
                torch.from_numpy(candidates.second),
                h,
                past,
                near,
            )
        )
    if len(candidates.sphere):
        parts.append(
            surface_contacts(
                world,
                positions,
                velocities,
                torch.from_numpy(candidates.sphere),
                torch.from_numpy(candidates.plane),
                torch.from_numpy(candidates.side).to(positions.dtype),
                h,
                past,
                near,
            )
        )
    return join(parts)


def _outside(local: Tensor, half: Tensor) -> Tensor:
    """Vector from the closest point of the rectangle, in its axes, shape (c, 3)."""
    inside = torch.maximum(torch.minimum(local[:, :2], half), -half)
    return torch.cat([local[:, :2] - inside, local[:, 2:]], dim=1)


def join(parts: list[Contacts]) -> Contacts:
    """Contacts of several kinds as one."""
    return Contacts(
        *(torch.cat([getattr(p, field.name) for p in parts]) for field in fields(Contacts))
    )


def gaps(world: World, positions: Tensor, contacts: Contacts) -> tuple[Tensor, Tensor]:
    """Gap and unit normal of each contact where the spheres are now, shapes (c,) and (c, 3)."""
    fixed = contacts.plane >= 0
    pad = torch.cat([positions, positions.new_zeros(1, 3)])
    offset = pad[contacts.a] - pad[contacts.b]
    if fixed.any():
        which = contacts.plane[fixed]
        axes = world.axes[which]
        local = torch.einsum('cij,cj->ci', axes, positions[contacts.a[fixed]] - world.point[which])
        rim = _outside(local, world.half[which])
        # on the other side of its plane it is inside
        straight = (rim[:, :2] == 0).all(1, keepdim=True)
        up = torch.zeros_like(rim)
        up[:, 2] = rim[:, 2]
        deep = straight & (contacts.side[fixed, None] * rim[:, 2:] < 0)
        offset = offset.clone()
        offset[fixed] = torch.einsum('cij,ci->cj', axes, torch.where(straight, up, rim))
        sign = torch.ones(len(offset), 1, dtype=offset.dtype)
        sign[fixed] = torch.where(deep, -1.0, 1.0).to(offset.dtype)
    else:
        sign = torch.ones(len(offset), 1, dtype=offset.dtype)
    length = offset.norm(dim=1, keepdim=True)
    normal = torch.where(length > 1e-9, sign * offset / length.clamp(min=1e-30), contacts.normal)
    reach = world.radius[contacts.a] + world.radius[contacts.b]
    return (sign * length)[:, 0] - reach, normal
