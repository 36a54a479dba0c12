# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The filter is compiled before the first frame, and for every layout of its input."""

from __future__ import annotations

from types import ModuleType

from numba.core.dispatcher import Dispatcher
import numpy as np
import pytest
from rigid_gns_core.kernels import neighbours
from rigid_gns_core.messages.poses import PoseArrayFrame
from rigid_gns_core.scenes.plane import Plane
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.tracking import association, coasting, gating, observations, window_fit
from rigid_gns_core.tracking.environment import Environment
from rigid_gns_core.tracking.velocity import estimate_motion
from rigid_gns_core.tracking.window import TrackingWindow

MODULES = association, coasting, gating, observations, window_fit, neighbours


def compiled_versions(modules: tuple[ModuleType, ...] = MODULES) -> dict[str, int]:
    """How many versions of each compiled function this process has."""
    return {
        f'{module.__name__}.{name}': len(value.signatures)
        for module in modules
        for name, value in vars(module).items()
        if isinstance(value, Dispatcher)
    }


def tracking_window(scene: Scene | None, *, matched: bool, length: int) -> TrackingWindow:
    return TrackingWindow(
        frame_id='world',
        length=length,
        max_spheres=100,
        gravity=(0.0, 0.0, -9.81),
        max_gap=1.0,
        radius=1.0,
        check=lambda _: None,
        on_gap=lambda _: None,
        scene=scene,
        matched=matched,
    )


@pytest.mark.parametrize('matched', [False, True])
@pytest.mark.parametrize('length', [1, 2, 6])
@pytest.mark.parametrize('known', [False, True])
def test_nothing_is_compiled_in_the_middle_of_a_run(
    matched: bool, length: int, known: bool
) -> None:
    scene = Scene(surfaces=(Plane(),), radius=(1.0,) * 4) if known else None
    window = tracking_window(scene, matched=matched, length=length)
    before = compiled_versions()
    assert sum(before.values()) > 0
    # a row in flight, of which two collide; one is not seen now and then
    rng = np.random.default_rng(0)
    places = np.array([[0.0, 0.0, 9.0], [6.0, 0.0, 9.0], [0.0, 30.0, 9.0], [0.0, 60.0, 9.0]])
    speeds = np.array([[8.0, 0.0, 0.0], [-8.0, 0.0, 0.0], [0.0, 0.0, 0.0], [9.0, 0.0, -9.0]])
    for step in range(20):
        time = 0.05 * step
        poses = np.zeros((4, 7))
        poses[:, :3] = places + speeds * time - [0.0, 0.0, 4.905 * time**2]
        poses[:, :3] += rng.normal(0.0, 0.1, (4, 3))
        poses[:, 6] = 1.0
        if matched:
            poses = poses[rng.permutation(4)[: 4 - step % 3 // 2]]
        window.add(PoseArrayFrame(round(time * 1e9), 'world', poses), 0)
        if window.full:
            window.start()
    assert window.full
    assert compiled_versions() == before


@pytest.mark.parametrize('layout', ['read-only', 'Fortran', 'every other', 'whole numbers'])
def test_every_layout_of_the_input_is_the_same(layout: str) -> None:
    tracking_window(None, matched=True, length=6)
    places = np.round(np.random.default_rng(0).normal(0.0, 30.0, (5, 7, 3)))
    given = {
        'read-only': places.copy(),
        'Fortran': np.asfortranarray(places),
        'every other': np.repeat(places, 2, axis=1)[:, ::2],
        'whole numbers': places.astype(np.int64),
    }[layout]
    given.flags.writeable = layout != 'read-only'
    before = compiled_versions()
    motions = [
        estimate_motion(
            np.arange(5),
            one,
            np.tile([0.0, 0.0, 0.0, 1.0], (5, 7, 1)),
            environment=Environment.of(Scene(surfaces=(Plane(),))),
            radii=np.ones(7),
            noise=0.1,
        )
        for one in (places, given)
    ]
    np.testing.assert_array_equal(motions[0].velocities, motions[1].velocities)
    assert compiled_versions() == before
