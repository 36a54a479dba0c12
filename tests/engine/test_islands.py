# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""Islands are the connected components of the contacts."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from . import calls


@pytest.mark.parametrize('seed', range(6))
def test_islands_are_connected_components(seed):
    rng = np.random.default_rng(seed)
    count, contacts = 80, (5, 20, 40, 60, 100, 200)[seed]
    one, other = rng.integers(0, count, (2, contacts))
    apart = one != other
    one, other = one[apart], other[apart]
    other[rng.random(len(other)) < 0.2] = -1  # with a surface, which belongs to no island
    made = calls.islands(count, one, other)
    groups = calls.groups(made)
    free = other >= 0
    graph = coo_array((np.ones(free.sum()), (one[free], other[free])), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    touched = np.unique(np.concatenate([one, other[free]]))
    np.testing.assert_array_equal(np.flatnonzero(made.touched), touched)
    expected = {tuple(touched[label[touched] == k].tolist()) for k in np.unique(label[touched])}
    found = {
        tuple(sorted(groups.members[groups.start[k] : groups.start[k + 1]].tolist()))
        for k in range(len(groups.grounded))
    }
    assert found == expected
    assert len(found) == len(groups.grounded)  # each of them once
    grounded = set(one[~free].tolist())
    for k, is_grounded in enumerate(groups.grounded):
        members = groups.members[groups.start[k] : groups.start[k + 1]].tolist()
        assert is_grounded == bool(grounded & set(members))


def test_no_contact_no_island():
    nothing = np.zeros(0, np.int64)
    assert len(calls.groups(calls.islands(5, nothing, nothing)).grounded) == 0
