# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Memory of a frame, allocated once: what its substeps and events find, they write here.

Compiled code counts references, atomically, for every array that a function which allocates is
given; in scenes of many small islands that and allocation took 40 % of the time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .blocks import Blocks, new_blocks
from .broad_phase import Candidates
from .contact_law import Law, new_law
from .contacts import Contacts
from .containment import Cuts, new_cuts
from .couplings import Couplings, new_couplings
from .direct import MOST_CONTACTS, new_pivots, Pivots
from .groups import new_contacts, new_order, Order
from .impacts import Impacts, new_impacts
from .impulses import Bodies, Impulses, no_impulses
from .motion import Motion, new_motion
from .overlap import new_overlaps, Overlaps
from .residuals import new_state, SolverState
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Flags, Indices
from ..scenes.state import Array


class Workspace(NamedTuple):
    """Scratch for n spheres with m candidates.

    Of a step: impacts, order, contacts, law, bodies, impulses, start, state, couplings, blocks,
    pivots,
    overlaps, cuts; path, mean: accelerations in air, shape (n, 3); positions: before the step,
    shape (n, 3).

    Of a substep: before: motion at its start; warm: impulses there; speeds: there, at least,
    shape (n,); everyone, every_pair: all indices; every: all flags, shape (m,); chosen: those of
    an event; missed: of a correction; label: island with events of each sphere, else -1; opening:
    of each of these, shape (n,); inner_label, inner_opening: of the steps of such an island;
    spheres, pairs: by these islands; sphere_begin, pair_begin: where each begins, shape (n + 2,);
    place: scratch.
    """

    impacts: Impacts
    order: Order
    contacts: Contacts
    law: Law
    bodies: Bodies
    impulses: Impulses
    start: Impulses
    state: SolverState
    couplings: Couplings
    blocks: Blocks
    pivots: Pivots
    overlaps: Overlaps
    cuts: Cuts
    path: Array
    mean: Array
    positions: Array
    before: Motion
    warm: Impulses
    speeds: Array
    everyone: Indices
    every_pair: Indices
    every: Flags
    chosen: Flags
    missed: Flags
    label: Indices
    opening: Array
    inner_label: Indices
    inner_opening: Array
    spheres: Indices
    pairs: Indices
    sphere_begin: Indices
    pair_begin: Indices
    place: Indices


@compiled
def new_workspace(spheres: int, fixed: int, candidates: Candidates) -> Workspace:
    """Room for so many spheres and fixed bodies with these candidates."""
    size, bodies = len(candidates.a), spheres + fixed
    moving = size if fixed > 1 else 0
    vectors, numbers = np.empty((8, bodies, 3)), np.empty((4, bodies))
    labels, begins = np.empty((3, spheres), np.int64), np.empty((3, spheres + 2), np.int64)
    flags = np.empty((3, size), np.bool_)
    flags[0] = True
    return Workspace(
        impacts=new_impacts(spheres, moving, size),
        order=new_order(spheres, size),
        contacts=new_contacts(size),
        law=new_law(size),
        bodies=Bodies(
            free_velocity=vectors[0],
            free_angular_velocity=vectors[1],
            velocity=vectors[2],
            angular_velocity=vectors[3],
            displacement=vectors[4],
            strongest=numbers[0],
        ),
        impulses=no_impulses(size),
        start=no_impulses(size),
        state=new_state(size),
        couplings=new_couplings(bodies),
        blocks=new_blocks(bodies, size),
        pivots=new_pivots(),
        overlaps=new_overlaps(bodies, size),
        cuts=new_cuts(spheres),
        path=vectors[5, :spheres],
        mean=vectors[6, :spheres],
        positions=vectors[7, :spheres],
        before=new_motion(spheres),
        warm=no_impulses(size),
        speeds=numbers[1],
        everyone=np.arange(spheres),
        every_pair=np.arange(size),
        every=flags[0],
        chosen=flags[1],
        missed=flags[2],
        label=labels[0],
        opening=numbers[2],
        inner_label=labels[1],
        inner_opening=numbers[3],
        spheres=labels[2],
        pairs=np.empty(size, np.int64),
        sphere_begin=begins[0],
        pair_begin=begins[1],
        place=begins[2],
    )


@in_place
def has_room(work: Workspace, spheres: int, fixed: int, candidates: int) -> bool:
    """Whether a workspace has room for so many."""
    bodies = len(work.bodies.strongest)
    fits = len(work.everyone) >= spheres and bodies >= spheres + fixed
    # none was made for large islands, or for bodies that move, where there were none
    large = candidates <= MOST_CONTACTS or len(work.blocks.own) > 0
    moving = fixed == 1 or len(work.impacts.surface_velocity) >= candidates
    return fits and large and moving and len(work.every_pair) >= candidates


@compiled
def workspace_among(work: Workspace, spheres: int, candidates: int) -> Workspace:
    """View for so many spheres and candidates; what is longer is scratch, and read by index."""
    order = Order(
        parent=work.order.parent[: spheres + 1],
        degree=work.order.degree,
        number=work.order.number,
        label=work.order.label,
        which=work.order.which,
        begin=work.order.begin,
        place=work.order.place,
    )
    return Workspace(
        impacts=work.impacts,
        order=order,
        contacts=work.contacts,
        law=work.law,
        bodies=work.bodies,
        impulses=work.impulses,
        start=work.start,
        state=work.state,
        couplings=work.couplings,
        blocks=work.blocks,
        pivots=work.pivots,
        overlaps=work.overlaps,
        cuts=work.cuts,
        path=work.path,
        mean=work.mean,
        positions=work.positions,
        before=work.before,
        warm=work.warm,
        speeds=work.speeds,
        everyone=work.everyone[:spheres],
        every_pair=work.every_pair[:candidates],
        every=work.every,
        chosen=work.chosen,
        missed=work.missed,
        label=work.label,
        opening=work.opening,
        inner_label=work.inner_label,
        inner_opening=work.inner_opening,
        spheres=work.spheres,
        pairs=work.pairs,
        sphere_begin=work.sphere_begin,
        pair_begin=work.pair_begin,
        place=work.place,
    )
