# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A scene and a start that are written and read back are the same to the bit."""

from __future__ import annotations

from dataclasses import replace
import json
from pathlib import Path

import numpy as np
import pytest
from rigid_gns_core import Air, ContactLaw, Obstacle, Plane, RestitutionCurve, Scene, State
from rigid_gns_core.data.records import read_record, Record, write_record
from rigid_gns_core.scenes.plane import MOTIONS, RANGES
from rigid_gns_core.scenes.sampling import sample_start
from rigid_gns_core.scenes.scene_file import load_start, write_start
from rigid_gns_core.scenes.state import as_unit, Trajectory

FIELDS = ('positions', 'quaternions', 'velocities', 'angular_velocities')
PLANES = 3000  # of which 71 % were others when every norm was divided by


def random_plane(rng: np.random.Generator) -> Plane:
    """A plane with none, one or two ends; its direction may be near its normal, or absent."""
    normal = rng.normal(size=3) * 10.0 ** rng.uniform(-6.0, 6.0)
    direction = [None, rng.normal(size=3), normal * (1.0 + 1e-3 * rng.normal(size=3))][
        rng.integers(3)
    ]
    lengths = np.where(rng.random(2) < 0.3, np.inf, 10.0 ** rng.uniform(-3.0, 3.0, 2))
    material = None if rng.random() < 0.5 else float(rng.random())
    law = random_law(rng) if material is None and rng.random() < 0.5 else None
    motion = {}
    if rng.random() < 0.3:
        motion = {'velocity': tuple(rng.normal(size=3)), 'angular_velocity': tuple(rng.random(3))}
    return Plane(
        tuple(rng.normal(size=3)), normal, direction, *lengths, material, material, law, **motion
    )


def random_law(rng: np.random.Generator) -> ContactLaw:
    """A contact law of a number or a curve."""
    curve = RestitutionCurve(*rng.random(3)) if rng.random() < 0.5 else float(rng.random())
    return ContactLaw(curve, *rng.random(5) * 10.0 ** rng.uniform(-9.0, 0.0, 5))


def random_obstacle(rng: np.random.Generator, k: int) -> Obstacle:
    """An obstacle of each shape in turn, with materials or a law."""
    radius, length, *size = (10.0 ** rng.uniform(-3.0, 3.0, 5)).tolist()
    shape, lengths = (
        ('sphere', {'radius': radius}),
        ('box', {'size': tuple(size), 'direction': tuple(rng.normal(size=3))}),
        ('cylinder', {'radius': radius, 'length': length}),
        ('ring', {'radius': radius, 'thickness': radius * rng.random()}),
        ('tube', {'radius': radius, 'length': length}),
    )[k % 5]
    own = {'contact': random_law(rng)} if k % 2 else {'restitution': float(rng.random())}
    return Obstacle(shape, tuple(rng.normal(size=3)), tuple(rng.normal(size=3)), **lengths, **own)


@pytest.fixture(scope='module')
def scene() -> Scene:
    rng = np.random.default_rng(0)
    return Scene(
        surfaces=tuple(random_plane(rng) for _ in range(PLANES)),
        radius=tuple(10.0 ** rng.uniform(-20.0, 20.0, 3)),
        mass=tuple(10.0 ** rng.uniform(-5.0, 5.0, 3)),
        restitution=float(rng.random()),
        gravity=tuple(rng.normal(size=3)),
        inertia_factor=tuple(rng.uniform(0.1, 0.6, 3)),
        air=Air(*rng.random(5), tuple(rng.normal(size=3)), 1e-7 * rng.random()),
        sphere_contact=ContactLaw(RestitutionCurve(*rng.random(3)), *rng.random(2)),
        obstacles=tuple(random_obstacle(rng, k) for k in range(200)),
    )


def bytes_of(scene: Scene) -> bytes:
    """All numbers of a scene, as its users see them."""
    parts = [
        np.concatenate(
            [p.point, p.axes.ravel(), [p.length_x, p.length_y], *(getattr(p, m) for m in MOTIONS)]
        )
        for p in scene.surfaces
    ]
    names = (*RANGES, 'gravity')
    parts += [
        np.array(repr([p.contact for p in scene.surfaces] + [scene.air, scene.sphere_contact]))
    ]
    return b''.join(np.asarray(part).tobytes() for part in parts) + b''.join(
        np.asarray(getattr(scene, name)).tobytes() for name in names
    )


def random_state(count: int) -> State:
    rng = np.random.default_rng(1)
    return State(
        positions=10.0 * np.arange(3 * count).reshape(count, 3) + rng.normal(size=(count, 3)),
        quaternions=rng.normal(size=(count, 4)),
        velocities=rng.normal(size=(count, 3)),
        angular_velocities=10.0 ** rng.uniform(-20.0, 20.0, (count, 3)),
    )


def test_a_scene_read_from_json_is_the_same_twice(scene: Scene) -> None:
    """As it travels in data files, checkpoints, and from the node to its bag."""
    once = Scene.from_mapping(json.loads(json.dumps(scene.to_mapping(), allow_nan=False)))
    twice = Scene.from_mapping(json.loads(json.dumps(once.to_mapping(), allow_nan=False)))
    assert scene == once == twice
    assert bytes_of(scene) == bytes_of(once) == bytes_of(twice)


def test_a_scene_file_read_and_written_again_is_the_same_file(tmp_path: Path) -> None:
    rng, start = np.random.default_rng(2), random_state(300)
    planes = [random_plane(rng) for _ in range(50)]
    # behind all spheres: given places must be free
    planes = [replace(plane, point=tuple(-1e6 * plane.axes[2])) for plane in planes]
    scene = Scene(surfaces=planes, radius=1e-3)
    write_start(tmp_path / 'once.yaml', scene, start)
    read, recipe = load_start(tmp_path / 'once.yaml')
    state = sample_start(read, recipe)
    assert read == scene and bytes_of(read) == bytes_of(scene)
    for name in FIELDS:
        assert getattr(state, name).tobytes() == getattr(start, name).tobytes(), name
    write_start(tmp_path / 'twice.yaml', read, state)
    assert (tmp_path / 'once.yaml').read_bytes() == (tmp_path / 'twice.yaml').read_bytes()


def test_the_scene_of_a_data_file_is_the_same(tmp_path: Path, scene: Scene) -> None:
    trajectory = Trajectory.from_states([random_state(3)], 0.1)
    record = Record(trajectory=trajectory, scene=scene, seed=0)
    once = read_record(write_record(tmp_path / 'once.h5', record)).scene
    assert once == scene and bytes_of(once) == bytes_of(scene)


def test_a_state_of_a_trajectory_is_the_one_that_was_put_in() -> None:
    state = random_state(1000)
    again = Trajectory.from_states([state], 0.1)[0]
    for name in FIELDS:
        assert getattr(again, name).tobytes() == getattr(state, name).tobytes(), name


@pytest.mark.parametrize('size', [2, 3, 4])
def test_a_unit_vector_is_left_alone_and_no_other(size: int) -> None:
    rng = np.random.default_rng(size)
    vectors = rng.normal(size=(100_000, size)) * 10.0 ** rng.uniform(-9.0, 9.0, (100_000, 1))
    unit = as_unit(vectors)
    # a rounding in each number and some of the norm
    assert np.abs(np.linalg.norm(unit, axis=1) - 1.0).max() < 1e-15
    assert as_unit(unit).tobytes() == unit.tobytes()
    off = as_unit(unit * (1.0 + 1e-14))
    assert np.abs(np.linalg.norm(off, axis=1) - 1.0).max() < 1e-15
