# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""Impulses of one substep are those that the next one starts from, contact by contact."""

import numpy as np
import pytest
from rigid_gns_core import load_simulator, Scene
from rigid_gns_core.engine.impulses import Impulses
from rigid_gns_core.engine.warm_start import cold_start, WarmStart

from . import calls


def drawn(rng, key):
    return WarmStart(
        key=np.array(key, np.int64),
        impulses=Impulses(
            normal=rng.uniform(0.1, 1.0, len(key)),
            tangential=rng.normal(size=(len(key), 3)),
            rolling=rng.normal(size=(len(key), 3)),
        ),
        known=True,
    )


def by_key(warm_start):
    return {
        key: np.r_[normal, tangential, rolling].tolist()
        for key, normal, tangential, rolling in zip(
            warm_start.key.tolist(), *warm_start.impulses, strict=True
        )
    }


@pytest.mark.parametrize('seed', range(4))
def test_impulses_are_found_by_key_and_zero_where_new(seed):
    rng = np.random.default_rng(seed)
    known = drawn(rng, np.unique(rng.integers(0, 60, 25)))
    key = np.unique(rng.integers(0, 60, 30))
    found = calls.warm(known, key)
    expected, nothing = by_key(known), [0.0] * 7
    assert by_key(WarmStart(key=key, impulses=found, known=True)) == {
        k: expected.get(k, nothing) for k in key.tolist()
    }


@pytest.mark.parametrize('seed', range(4))
def test_sleepers_keep_their_impulses(seed):
    rng = np.random.default_rng(seed)
    count, planes = 10, 2
    first = np.arange(count)
    of = np.r_[np.repeat(first, count), np.repeat(first, planes)]  # sphere of each key
    awake = rng.random(count) < 0.6
    key = np.unique(rng.integers(0, len(of), 40))
    new, old = drawn(rng, key[awake[of[key]]][::2]), drawn(rng, key)
    merged = calls.slept(new, old, awake, planes)
    assert (np.diff(merged.key) > 0).all()
    asleep = {k: v for k, v in by_key(old).items() if not awake[of[k]]}
    assert by_key(merged) == asleep | by_key(new)


def test_a_start_has_no_impulses():
    start = cold_start()
    assert not start.known and len(start.key) == 0


def test_a_pile_that_rests_keeps_the_impulses_that_carry_it():
    count = 5
    positions = np.c_[np.zeros((count, 2)), 1.0 + 2.0 * np.arange(count)]
    stepper = load_simulator(sleep=False).start(Scene(restitution=0.3), positions).stepper
    for _ in range(40):  # each starts from the last, so that all converge in time
        stepper.step()
    carried = 9.81 * 0.1 / 8 * np.arange(count, 0, -1)  # weight above, in a substep
    np.testing.assert_allclose(
        np.sort(stepper.warm_start.impulses.normal), np.sort(carried), rtol=1e-9
    )
