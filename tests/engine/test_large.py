# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""Large islands, eight contacts at once: their law, and into how many parts bodies are split."""

import numba
import numpy as np
import pytest
from rigid_gns_core import Plane, Scene
from rigid_gns_core.engine import blocks as fields
from rigid_gns_core.engine.block_filling import fill
from rigid_gns_core.engine.blocks import new_blocks, STRIDE
from rigid_gns_core.engine.impulses import Bodies, Impulses, no_impulses
from rigid_gns_core.engine.large_law import _find_targets
from rigid_gns_core.engine.splitting import split_large
from rigid_gns_core.engine.world import world_of
from rigid_gns_core.kernels.lanes import load

from . import calls
from .test_couplings import jacobian

WRITTEN = (
    'NX', 'NY', 'NZ', 'ARM_A', 'ARM_B', 'UNIT', 'TURN', 'TURNING', 'TIME', 'GAP', 'SPEED', 'PULL',
    'APART', 'SLOWEST', 'FALL_X', 'FALL_Y', 'FALL_Z', 'SLOW', 'FRICTION', 'ROLL', 'SPINNING',
    'INERTIA', 'ORBIT', 'FAST', 'REBOUND', 'GROWTH',
)  # fmt: skip
IMPULSES = ('NORMAL', 'TX', 'TY', 'TZ', 'QX', 'QY', 'QZ', 'NORMAL_0', 'TX_0', 'TY_0', 'TZ_0')
LAW = ('TIME', 'GAP', 'SPEED', 'PULL', 'SLOW', 'LASTING')  # FAST is SLOW, too


@numba.njit(error_model='numpy')
def targets(values, h, lasting):
    _find_targets(values, 0, h, load(values, lasting), False)


@pytest.mark.parametrize('seed', range(3))
def test_law_is_that_of_one_contact(seed):
    rng = np.random.default_rng(seed)
    h = 0.0125
    for _ in range(60):
        block = np.zeros((STRIDE // 8, 8))

        def field(name, values, block=block):
            block[getattr(fields, name) // 8] = values

        kinds = rng.integers(0, 3, 8)  # it touches, meets or is speculative
        time = np.choose(kinds, [rng.choice([0.0, -0.003], 8), rng.uniform(0, h, 8), np.zeros(8)])
        gap = np.where(kinds == 2, 10 ** rng.uniform(-6, -3, 8), 0.0)
        given = (
            time,
            gap,
            rng.choice([1e-3, 0.03, 0.1, 1.0, 10.0], 8) * rng.normal(size=8),
            rng.choice([0.0, -9.81], 8),
            rng.choice([0.0, 0.4, 0.8, 1.0], 8),
            rng.choice([0.0, 5.0, -20.0], 8) * rng.uniform(size=8),
        )
        for name, values in zip(LAW, given, strict=True):
            field(name, values)
        field('FAST', given[4])
        targets(block.reshape(-1), h, fields.LASTING)
        for lane in range(8):
            time, gap, speed, pull, e, lasting = (values[lane] for values in given)
            one = calls.target(e, h, time, gap, speed, pull, lasting)
            found = block[:, lane]
            assert found[fields.HIT // 8] == one.active
            assert found[fields.BOUNCED // 8] == one.bounced
            impulse = one.impulse_time * max(one.impulse, 1e-9)
            for name, value in (
                ('SEPARATION', one.separation_velocity),
                ('FLIGHT', one.flight_time),
                ('IMPULSE', one.impulse),
                ('LEVERAGE', impulse),
                ('REMAINING', one.remaining),
            ):
                close = pytest.approx(value, rel=1e-12, abs=1e-14 * max(1.0, abs(speed)))
                assert found[getattr(fields, name) // 8] == close


@numba.njit(error_model='numpy')
def steps(world, contacts, law, count):
    """Steps by unit residual and by unit slip, of contacts that all count wholly."""
    size = len(contacts.a)
    blocks, still = new_blocks(count, size), np.zeros((count + 1, 3))
    bodies = Bodies(still, still, still, still, still, np.zeros(count + 1))
    start = no_impulses(size)
    pairs, filled, moving = fill(world, contacts, law, start, still, 0.01, bodies, blocks)
    for q in range(filled):
        for lane in range(8):
            blocks.values[q * STRIDE + fields.STRENGTH + lane] = 0.0
    places = blocks.place // 8 * STRIDE + blocks.place % 8
    for k in range(size):
        blocks.values[places[k] + fields.STRENGTH] = 1.0
    split_large(blocks, pairs, filled, moving)
    return blocks.values[places + fields.STEP], blocks.values[places + fields.RUB]


@numba.njit(error_model='numpy')
def filled(world, contacts, law, start, motion):
    """Blocks of contacts, shape (blocks, fields, 8), with bodies a and b."""
    blocks, still = new_blocks(len(motion), len(contacts.a)), np.zeros((len(motion), 3))
    bodies = Bodies(motion, still, motion, still, still, np.zeros(len(motion)))
    _, count, _ = fill(world, contacts, law, start, still, 0.01, bodies, blocks)
    values = blocks.values[: count * STRIDE].copy().reshape((count, STRIDE // 8, 8))
    return values, blocks.a[: 8 * count].copy(), blocks.b[: 8 * count].copy()


def test_eight_contacts_are_written_as_one_by_one():
    rng = np.random.default_rng(3)
    count, scene = 60, Scene(surfaces=Plane.box(5.0, 5.0), radius=0.5, rolling_friction=0.03)
    world = world_of(scene, count)
    positions = rng.uniform([-2.2, -2.2, 0.3], [2.2, 2.2, 3.0], (count, 3))
    found = calls.contacts(world, positions, rng.normal(size=(count, 3)), 0.1, 0.0125, 0.0125)
    order = np.argsort(found.plane >= 0, kind='stable')  # those of two spheres are first
    found = type(found)(*(values[order] for values in found))
    assert (found.plane < 0).sum() > 40
    law, size = calls.law(world, found), len(found.a)
    start = Impulses(rng.uniform(size=size), rng.normal(size=(size, 3)), np.zeros((size, 3)))
    motion = rng.normal(size=(count + 1, 3))
    # with laws, which nothing has, contacts are written one by one
    lanes = filled(world, found, law, start, motion)
    single = filled(world._replace(has_laws=True), found, law, start, motion)
    for name in (*WRITTEN, *IMPULSES):
        row = getattr(fields, name) // 8
        np.testing.assert_array_equal(lanes[0][:, row], single[0][:, row], err_msg=name)
    np.testing.assert_array_equal(lanes[1], single[1])
    np.testing.assert_array_equal(lanes[2], single[2])


@pytest.mark.parametrize('seed', range(8))
def test_steps_of_all_contacts_at_once_do_not_diverge(seed):
    # a close packing, turned somehow, and on a floor
    rng = np.random.default_rng(seed)
    cells = np.stack(np.meshgrid(*[np.arange(-2, 3)] * 3), -1).reshape(-1, 3)
    cells = cells[cells.sum(axis=1) % 2 == 0]
    cells = cells[np.argsort((cells**2).sum(axis=1), kind='stable')][:19]
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    positions = np.sqrt(2.0) * 0.995 * cells @ turn + rng.uniform(-3e-3, 3e-3, (19, 3))
    positions[:, 2] += 0.99 - positions[:, 2].min()
    count, mass = len(positions), 10.0 ** rng.uniform(-1, 1, len(positions))
    scene = Scene(surfaces=(Plane(),), mass=tuple(mass), friction=0.5)
    world = world_of(scene, count)
    contacts = calls.contacts(world, positions, np.zeros((count, 3)), 0.1, 0.01, 0.01)
    law = calls.law(world, contacts)
    size = len(contacts.a)
    assert size > 40
    normal, friction = steps(world, contacts, law, count)
    inverse = np.repeat(np.r_[world.inverse_mass[:-1], world.inverse_inertia[:-1]], 3)
    # a step multiplies the error by 1 - D^-1 A: for normals it may pass the solution, but by less
    # than it was off; for friction it does not
    largest = 0.5 * (1.0 + np.sqrt(3.0))
    for step, across, most in ((normal, False, largest), (friction, True, 1.0)):
        rows = np.concatenate([jacobian(world, contacts, law, k, across) for k in range(size)])
        matrix = rows @ (inverse[:, None] * rows.T)
        root = np.sqrt(np.repeat(step, 2 if across else 1))
        assert np.linalg.eigvalsh(root[:, None] * matrix * root).max() < most + 1e-9
