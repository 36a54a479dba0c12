# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Normal impulses of few contacts at once, exactly: a linear complementarity problem.

Impulses push, bodies part at least as their law says, and only contacts whose law holds exactly
push: x >= 0, y = A x - b >= 0, x . y = 0. A_kl is the change of separation velocity k by a unit of
impulse l. Solved by block principal pivoting (Judice, Pires, An experimental investigation of
pivoting methods, 1994), with a Cholesky factorisation in each step. Whatever the ratio of masses,
in iterations that would need as many as that ratio.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .contacts import Contacts
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import dot, row
from ..scenes.state import Array

# most contacts that are solved so: beyond, a factorisation costs more than iterations
MOST_CONTACTS = 16
# share of the diagonal that is added to it: contacts more than bodies can tell share the force
_RIDGE = 1e-11
# impulses larger than this times what single contacts need show that there is no solution
_NO_SOLUTION = 1e9
# violations [of the largest impulse and speed] up to which a condition holds
_ROUNDING = 1e-12
# exchanges of all violations without progress before only the last is exchanged
_PATIENCE = 3


class Pivots(NamedTuple):
    """Scratch of `solve_normals`, kept from one solution to the next; c contacts, m the most.

    matrix: A, in its first c rows and columns, shape (m, m); lower: its Cholesky factor among the
    contacts that push, likewise; among: these, shape (c,); pushes: which they are, shape (c,);
    pushing: how many, -1 where nothing is factorised, shape (1,); goal, impulse, opening: b, x and
    y, shape (c,).
    """

    matrix: Array
    lower: Array
    among: Indices
    pushes: Flags
    pushing: Indices
    goal: Array
    impulse: Array
    opening: Array


@compiled
def new_pivots() -> Pivots:
    """Scratch for as many contacts as are solved so."""
    numbers = np.zeros((3, MOST_CONTACTS))
    return Pivots(
        matrix=np.empty((MOST_CONTACTS, MOST_CONTACTS)),
        lower=np.empty((MOST_CONTACTS, MOST_CONTACTS)),
        among=np.empty(MOST_CONTACTS, np.int64),
        pushes=np.zeros(MOST_CONTACTS, np.bool_),
        pushing=np.full(1, -1),
        goal=numbers[0],
        impulse=numbers[1],
        opening=numbers[2],
    )


@in_place
def pivots_of(world: World, contacts: Contacts, scratch_out: Pivots) -> Pivots:
    """View of the scratch for these contacts, A = n_k . n_l over the mass of each shared body."""
    size, a, b, mass = len(contacts.a), contacts.a, contacts.b, world.inverse_mass
    matrix = scratch_out.matrix
    for k in range(size):
        for m in range(k + 1):
            same = mass[a[k]] * (a[k] == a[m]) + mass[b[k]] * (b[k] == b[m])
            same -= mass[a[k]] * (a[k] == b[m]) + mass[b[k]] * (b[k] == a[m])
            value = 0.0
            if same != 0:
                value = same * dot(row(contacts.normal, k), row(contacts.normal, m))
            matrix[k, m] = matrix[m, k] = value
    scratch_out.pushing[0] = -1
    return Pivots(
        matrix=matrix,
        lower=scratch_out.lower,
        among=scratch_out.among[:size],
        pushes=scratch_out.pushes[:size],
        pushing=scratch_out.pushing,
        goal=scratch_out.goal[:size],
        impulse=scratch_out.impulse[:size],
        opening=scratch_out.opening[:size],
    )


@in_place
def solve_normals(active: Flags, pivots_out: Pivots) -> bool:
    """Impulses x >= 0 with A x >= b, and A x = b where x > 0; False where there are none.

    Args:
        active: Contacts that may push, shape (c,).
        pivots_out: With the matrix and `goal`; `impulse` has those of the start, and is written
            where there is a solution.
    """
    p, size = pivots_out, len(active)
    largest, fewest, patience = 0.0, size + 1, _PATIENCE
    for q in range(size):
        largest = max(largest, math.fabs(p.goal[q]))
        pushes = active[q] and (p.goal[q] > 0 or p.impulse[q] > 0)
        if pushes != p.pushes[q]:
            p.pushes[q], p.pushing[0] = pushes, -1
    for _ in range(4 * size + 8):
        if p.pushing[0] < 0:
            _factorise(p)
        _solve_among(p)
        strongest, violated, last = 0.0, 0, -1
        for q in range(size):
            strongest = max(strongest, math.fabs(p.impulse[q]) * p.matrix[q, q])
        for q in range(size):
            wrong = p.impulse[q] * p.matrix[q, q] < -_ROUNDING * strongest
            if active[q] and not p.pushes[q]:
                opening = -p.goal[q]
                for r in range(p.pushing[0]):
                    opening += p.matrix[q, p.among[r]] * p.impulse[p.among[r]]
                wrong = opening < -_ROUNDING * (largest + strongest)
            p.opening[q] = -1.0 if wrong else 0.0
            if wrong:
                violated, last = violated + 1, q
        if violated == 0:
            for q in range(size):
                p.impulse[q] = max(p.impulse[q], 0.0)
            return strongest <= _NO_SOLUTION * largest
        patience = _PATIENCE if violated < fewest else patience - 1
        fewest = min(fewest, violated)
        for q in range(size):
            if p.opening[q] < 0 and (patience >= 0 or q == last):
                p.pushes[q] = not p.pushes[q]
        p.pushing[0] = -1
    return False


@in_place
def _factorise(pivots_out: Pivots) -> None:
    """Cholesky's factor of A among the contacts that push."""
    p, size = pivots_out, 0
    for q in range(len(p.pushes)):
        if p.pushes[q]:
            p.among[size] = q
            size += 1
    p.pushing[0] = size
    for q in range(size):
        diagonal = p.matrix[p.among[q], p.among[q]]
        for r in range(q + 1):
            value = p.matrix[p.among[q], p.among[r]]
            for t in range(r):
                value -= p.lower[q, t] * p.lower[r, t]
            if r < q:
                p.lower[q, r] = value / p.lower[r, r]
            else:
                value += _RIDGE * diagonal
                p.lower[q, q] = math.sqrt(max(value, 1e-3 * _RIDGE * diagonal))


@in_place
def _solve_among(pivots_out: Pivots) -> None:
    """Solve A x = b among the contacts that push; x is 0 elsewhere."""
    p, size = pivots_out, pivots_out.pushing[0]
    x = p.impulse
    x[:] = 0.0
    for q in range(size):
        value = p.goal[p.among[q]]
        for r in range(q):
            value -= p.lower[q, r] * x[p.among[r]]
        x[p.among[q]] = value / p.lower[q, q]
    for back in range(size):
        q = size - 1 - back
        value = x[p.among[q]]
        for r in range(q + 1, size):
            value -= p.lower[r, q] * x[p.among[r]]
        x[p.among[q]] = value / p.lower[q, q]
