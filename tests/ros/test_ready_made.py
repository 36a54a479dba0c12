# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files that come with the package: parameter files, scenes, RViz2, Foxglove, package.xml."""

from __future__ import annotations

import ast
import json
from pathlib import Path
import re
from typing import Any
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from rigid_gns_core.forecasts.forecaster import Forecaster
from rigid_gns_core.forecasts.node_parameters import SIMULATOR
from rigid_gns_core.scenes.sampling import sample_start
from rigid_gns_core.scenes.scene_file import load_scene, load_start
import yaml

ROOT = Path(__file__).resolve().parents[2]
FILES = sorted((ROOT / 'config').glob('*.yaml'))
SPECS = {spec.name: spec for spec in SIMULATOR}


def parameters(file: Path) -> dict[str, Any]:
    content = yaml.safe_load(file.read_text(encoding='utf-8'))
    assert list(content) == ['/**'] and list(content['/**']) == ['ros__parameters']
    return content['/**']['ros__parameters']


def test_there_is_a_file_for_each_use() -> None:
    assert {file.name for file in FILES} == {
        'billiards.yaml',
        'box.yaml',
        'simulator.yaml',
        'table_tennis.yaml',
    }


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_parameter_files_hold_values_that_are_allowed(file: Path) -> None:
    for name, value in parameters(file).items():
        spec = SPECS[name]
        assert type(value) is type(spec.default), name
        assert spec.problem(value) is None
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            assert spec.low <= value <= spec.high


@pytest.mark.parametrize(
    ('name', 'radius', 'hertz'),
    [
        ('table_tennis', 0.02, 70.71),
        ('billiards', 0.028575, 59.16),
        ('carom', 0.03075, 57.03),
        ('juggling', 0.035, 53.45),
        ('box_154', 1.0, 10.0),
    ],
)
def test_scenes_can_be_predicted(name: str, radius: float, hertz: float) -> None:
    scene, recipe = load_start(name)
    model = Forecaster('', scene)
    assert scene.radius == radius and scene.gravity == (0.0, 0.0, -9.81)
    assert 1 / model.native_dt == pytest.approx(hertz, abs=0.005)
    state = sample_start(scene, recipe)
    assert not model.check(len(state))
    forecast = model.forecast(state, 0)
    prediction = forecast.advance_to(round(10 * model.native_dt * 1e9))
    assert np.isfinite(prediction.poses).all()


def test_a_ball_falls_and_rises_in_air_as_its_closed_form_says() -> None:
    scene = load_scene('table_tennis')
    from rigid_gns_core.prediction.load import load_simulator

    assert scene.air is not None and scene.surfaces[0].contact is not None
    air, height = scene.air, 0.3
    paths = load_simulator().rollout(scene, [[0.5, 0.2, 0.02 + height]], steps=60)
    heights = paths.positions[:40, 0, 2]
    lowest = int(np.argmin(heights))
    # U^2 = 2 (m - rho V) g / (rho A C_d); it falls to v^2 = U^2 (1 - exp(-2 a h / U^2)), with
    # a = (m - rho V) g / (m + rho V / 2), and rises to U^2 / 2 a log(1 + (e v)^2 / U^2)
    own, displaced = 0.0027, float(air.displaced_mass(0.02))
    limit = 2 * (own - displaced) * 9.81 / (air.density * np.pi * 0.02**2 * air.drag_coefficient)
    pull = (own - displaced) * 9.81 / (own + 0.5 * displaced)
    speed = limit * (1 - np.exp(-2 * pull * height / limit))
    restitution = scene.surfaces[0].contact.curve.fast
    apex = limit / (2 * pull) * np.log(1 + restitution**2 * speed / limit)
    # sampled each 14 ms: the apex is between two steps, at most g (dt / 2)^2 / 2 = 0.25 mm above
    assert heights[lowest:].max() - 0.02 == pytest.approx(apex, abs=0.3e-3)


def test_a_billiard_ball_slows_down_as_its_rolling_resistance_says() -> None:
    scene = load_scene('billiards')
    from rigid_gns_core.prediction.load import load_simulator

    speed, radius = 0.5, 0.028575
    trajectory = load_simulator().rollout(
        scene, [[-1.0, 0.0, radius]], [[speed, 0.0, 0.0]], [[0.0, speed / radius, 0.0]], steps=60
    )
    lost = speed - trajectory.velocities[-1, 0, 0]
    # rho g / (1 + i)
    assert lost / (60 * trajectory.dt) == pytest.approx(0.0064 * 9.81 / 1.4, rel=0.02)


# --- what shows it ---

TOPICS = {
    'tracked_poses': 'PoseArray',
    'predicted_poses': 'PoseArray',
    'predicted_markers': 'MarkerArray',
    'simulator/surfaces': 'MarkerArray',
}


def test_rviz_shows_topics_of_the_node() -> None:
    content = yaml.safe_load((ROOT / 'rviz' / 'rigid_gns.rviz').read_text(encoding='utf-8'))
    manager = content['Visualization Manager']
    assert manager['Global Options']['Fixed Frame'] == SPECS['frame_id'].default
    shown = {
        display['Topic']['Value']: display['Class'].split('/')[1]
        for display in manager['Displays']
        if 'Topic' in display
    }
    assert shown == TOPICS
    reliability = {
        display['Topic']['Value']: display['Topic']['Reliability Policy']
        for display in manager['Displays']
        if 'Topic' in display
    }
    # a reliable subscription would not match a best-effort tracker
    assert reliability['tracked_poses'] == 'Best Effort'


def test_foxglove_shows_topics_of_the_node() -> None:
    text = (ROOT / 'foxglove' / 'rigid_gns.json').read_text(encoding='utf-8')
    content = json.loads(text)
    panels = content['configById']
    assert {topic.lstrip('/') for topic in panels['3D!rigid_gns']['topics']} == set(TOPICS)
    placed = set(re.findall(r'"(?:first|second)": "([^"]+)"', text))
    assert placed == set(panels)


# --- what it depends on ---


def test_package_xml_names_all_ros_packages_that_are_imported() -> None:
    root = ElementTree.parse(ROOT / 'package.xml').getroot()
    named = {element.text for element in root if element.tag.endswith('depend')}
    files = [*(ROOT / 'rigid_gns_ros').rglob('*.py'), *(ROOT / 'launch').glob('*.py')]
    imported = set()
    for file in files:
        for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
            if isinstance(node, ast.ImportFrom) and node.module and not node.level:
                imported.add(node.module.split('.')[0])
            elif isinstance(node, ast.Import):
                imported |= {alias.name.split('.')[0] for alias in node.names}
    ros = {
        name
        for name in imported
        if name.endswith(('_msgs', '_srvs', '_ros', '_interfaces')) or name in ('rclpy', 'launch')
    }
    assert ros - {'rigid_gns_ros'} <= named
    assert {'ros2bag', 'rosbag2_storage_mcap'} <= named  # of playback_launch.py
