# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""Options of the laws, and what becomes of them."""

import warnings

import numpy as np
import pytest
from rigid_gns_core import load_simulator, Scene
from rigid_gns_core.engine.stepper import EngineStepper
from rigid_gns_core.prediction.laws import LawsSimulator


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        ({'gaurd': True}, "unknown key 'gaurd', allowed: guard, sleep, substeps, rounds"),
        ({'network': False}, "unknown key 'network', allowed: guard, sleep, substeps, rounds"),
        ({'rounds': 0}, 'rounds is 0, expected at least 1'),
        ({'substeps': 0}, 'substeps is 0, expected at least 1'),
    ],
)
def test_wrong_options_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        load_simulator(**options)


def test_options_reach_the_rollout():
    stepper = load_simulator().start(Scene(), [[0.0, 0, 3]]).stepper
    assert isinstance(stepper, EngineStepper)
    assert stepper.guards and stepper.sleeps
    assert tuple(stepper.settings) == (8, 4)
    options = {'guard': False, 'sleep': False, 'substeps': 5, 'rounds': 9}
    simulator = load_simulator('laws', **options)
    stepper = simulator.start(Scene(), [[0.0, 0, 3]]).stepper
    assert not stepper.guards and not stepper.sleeps
    assert tuple(stepper.settings) == (5, 9)
    assert simulator.card['options'] == options and simulator.card['kind'] == 'laws'


def test_the_default_is_the_laws():
    for name in (None, '', 'laws'):
        simulator = load_simulator(name)
        assert isinstance(simulator, LawsSimulator)
        assert simulator.name == simulator.kind == 'laws'
        assert simulator.velocities == 'given'


def test_no_material_is_beyond_the_laws():
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        scene = Scene(restitution=0.999, friction=3.0, radius=(1.0, 0.01), mass=(1.0, 1000.0))
        load_simulator().rollout(scene, [[0.0, 0, 3], [3.0, 0, 3]], steps=3)


def test_no_sphere_and_no_step_are_fine():
    t = load_simulator().rollout(Scene(), np.zeros((0, 3)), steps=3)
    assert t.positions.shape == (4, 0, 3)
    assert load_simulator().rollout(Scene(), [[0.0, 0, 3]], steps=0).steps == 0
