# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node says when states leave what its residual network was trained on, over DDS."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')
pytest.importorskip('torch', reason='a network is trained')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rigid_gns_core.data.records import Record
from rigid_gns_core.files.checkpoint import save_model
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.scenes.scene_file import load_scene
from rigid_gns_core.training.recipes import load_recipe
from rigid_gns_core.training.train import Trainer

# places in which spheres, side by side, fall as high as in training and from five times as high
LOW, HIGH = 1.3, 7.5


def falling_from(height: float) -> np.ndarray:
    """Poses of two spheres, shape (2, 7)."""
    return np.array([[0.0, 0, height, 0, 0, 0, 1], [4.0, 0, height + 0.1, 0, 0, 0, 1]])


def model_of_low_falls(folder: Path, strength: float) -> str:
    """A network that has seen nothing but falls from `LOW`, and has learned little of them."""
    scene, poses = load_scene('box_154'), falling_from(LOW)
    made = load_simulator('laws').rollout(scene, poses[:, :3], steps=20)
    recipe = replace(
        load_recipe('residual'), steps=2, batch=2, validate_every=2, pushforward_frames=0
    )
    trainer = Trainer(recipe, [Record(trajectory=made, scene=scene, seed=0)], [], folder)
    trainer.run()
    network = trainer.learner.network
    network.strength.fill_(strength)  # one track cannot choose it
    save_model(folder / 'used', network, trainer.card(None))
    return str(folder / 'used')


@pytest.mark.parametrize(
    ('height', 'strength', 'level', 'said'),
    [
        (LOW, 1.0, DiagnosticStatus.OK, 'like those that the network was trained on'),
        (HIGH, 1.0, DiagnosticStatus.WARN, 'unlike those that the network was trained on'),
        (HIGH, 0.0, DiagnosticStatus.OK, 'switched off, as held-out tracks have chosen'),
    ],
)
def test_it_says_when_contacts_are_unlike_those_of_training(
    simulated: Callable[..., Any],
    tmp_path: Path,
    height: float,
    strength: float,
    level: bytes,
    said: str,
) -> None:
    setup = simulated(model=model_of_low_falls(tmp_path, strength))
    heard: list[DiagnosticArray] = []
    setup.bench.tester.create_subscription(DiagnosticArray, '/diagnostics', heard.append, 10)
    setup.start(falling_from(height))
    setup.run(20)
    heard.clear()
    setup.bench.until(lambda: len(heard) >= 2, 'two reports')
    (status,) = [one for one in heard[-1].status if one.name == 'simulator: residual']
    values = {item.key: item.value for item in status.values}
    assert status.level == level and said in status.message
    assert float(values['strength']) == strength
    contacts, left = float(values['contacts']), float(values['left to the laws'])
    if strength:
        assert contacts >= 2  # each sphere has met the floor
        assert (left > 0.1 * contacts) == (level == DiagnosticStatus.WARN)
    else:
        assert contacts == 0
