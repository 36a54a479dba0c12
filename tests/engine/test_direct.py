# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""Normal impulses of few contacts, beside a search through all sets of contacts that push."""

from itertools import product

import numba
import numpy as np
import pytest
from rigid_gns_core.engine.direct import new_pivots, Pivots, solve_normals


@numba.njit(error_model='numpy')
def solved(matrix, goal, active):
    size, scratch = len(goal), new_pivots()
    scratch.matrix[:size, :size] = matrix
    pivots = Pivots(
        matrix=scratch.matrix,
        lower=scratch.lower,
        among=scratch.among[:size],
        pushes=scratch.pushes[:size],
        pushing=scratch.pushing,
        goal=scratch.goal[:size],
        impulse=scratch.impulse[:size],
        opening=scratch.opening[:size],
    )
    pivots.goal[:] = goal
    return solve_normals(active, pivots), pivots.impulse


def searched(matrix, goal, active):
    """The one set of pushing contacts for which x >= 0 and A x >= b among the active ones."""
    count = len(goal)
    for pushes in product((False, True), repeat=count):
        pushes = np.array(pushes) & active
        x = np.zeros(count)
        x[pushes] = np.linalg.solve(matrix[np.ix_(pushes, pushes)], goal[pushes])
        if (x >= 0).all() and (matrix @ x - goal)[active].min(initial=0.0) > -1e-12:
            return x
    raise AssertionError('no set')


@pytest.mark.parametrize('seed', range(30))
def test_the_solution_is_the_one_set_that_fits(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 8))
    rows = rng.normal(size=(count, count + 2))
    matrix, goal = rows @ rows.T, rng.normal(size=count)
    active = rng.uniform(size=count) < 0.8
    found, x = solved(matrix, goal, active)
    assert found
    # the ridge of 1e-11 times the condition of these matrices
    assert x == pytest.approx(searched(matrix, goal, active), rel=1e-6, abs=1e-7)


@pytest.mark.parametrize('ratio', [10.0, 1e3, 1e6])
def test_a_heavy_body_on_a_light_one_needs_no_iterations(ratio):
    # masses 1 on the floor and `ratio` on it, which falls at 1
    matrix = np.array([[1.0, -1.0], [-1.0, 1.0 + 1.0 / ratio]])
    found, x = solved(matrix, np.array([0.0, 1.0]), np.ones(2, bool))
    assert found
    assert x == pytest.approx([ratio, ratio], rel=1e-4)  # the ridge, times the ratio


def test_contacts_that_carry_the_same_share_it():
    matrix = np.ones((3, 3))
    found, x = solved(matrix, np.ones(3), np.ones(3, bool))
    assert found
    assert x.sum() == pytest.approx(1.0, rel=1e-9)
    assert (x >= 0).all()


def test_what_cannot_be_is_told():
    # a body between two walls that shall leave both
    matrix = np.array([[1.0, -1.0], [-1.0, 1.0]])
    assert not solved(matrix, np.array([1.0, 0.5]), np.ones(2, bool))[0]
