# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names, QoS, gravity and threads of the simulator node; docs/node.md says the same."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import re
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rigid_gns_core.forecasts.forecaster import Forecaster, scene_of, with_gravity_along
from rigid_gns_core.forecasts.node_parameters import SIMULATOR
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.scene_file import load_scene
from rigid_gns_core.scenes.similarity import _upright
from rigid_gns_core.scenes.state import quaternion_multiply, State
from rigid_gns_ros.node.simulator import SimulatorNode
from threadpoolctl import threadpool_info

ROOT = Path(__file__).resolve().parents[3]
T0, DT = 1_000_123_456_789, 100_000_000  # [ns], as in conftest.py
Falling = Rollout = Simulated = Callable[..., Any]
# of every node
# the last two where tf2_msgs is installed
OURS_NOT = {'/rosout', '/parameter_events', '/clock', '/tf_static', '/tf'}


def cells(heading: str) -> list[list[str]]:
    """Rows of the first table after a heading of the simulator's part of docs/node.md."""
    text = (ROOT / 'docs' / 'node.md').read_text(encoding='utf-8')
    part = text.split('\n## simulator\n')[1].split('\n## ')[0]
    part = part.split(f'\n### {heading}\n')[1]
    rows = re.search(r'\n\|---.*\n((?:\|.*\n)+)', part)
    assert rows
    return [[cell.strip() for cell in row.strip('|').split('|')] for row in rows[1].splitlines()]


def quality(profile: QoSProfile) -> str:
    if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
        return 'latched'
    best_effort = profile.reliability == ReliabilityPolicy.BEST_EFFORT
    return f'{"best effort" if best_effort else "reliable"}, depth {profile.depth}'


def kind(ros_type: Any) -> str:
    return f'{ros_type.__module__.split(".")[0]}/{ros_type.__name__}'


def span(descriptor: Any) -> str:
    """Return unit and range of a parameter, or the choices, as its descriptor has them."""
    unit = re.search(r' \[([^]]+)\]$', descriptor.description)
    ranges = [*descriptor.floating_point_range, *descriptor.integer_range]
    values = [f'{one.from_value:.10g} to {one.to_value:.10g}' for one in ranges]
    choices = re.findall('^one of: (.*)', descriptor.additional_constraints)
    return ', '.join([*([unit[1]] if unit else []), *values, *choices])


def test_the_document_has_the_topics(simulated: Simulated) -> None:
    node = simulated().node
    ends = [(publisher, 'out') for publisher in node.publishers]
    ends += [(subscription, 'in') for subscription in node.subscriptions]
    found = {
        f'`{end.topic_name}`': [kind(end.msg_type), f'{way}, {quality(end.qos_profile)}']
        for end, way in ends
        if end.topic_name not in OURS_NOT
    }
    rows = {row[0]: row[1:3] for row in cells('Topics')}
    resolved = {
        name.replace('~', '/simulator') if name[1] in '~/' else f'`/{name[1:]}': row
        for name, row in rows.items()
    }
    assert resolved == found


def test_rviz_and_foxglove_show_topics_of_the_node(simulated: Simulated) -> None:
    node = simulated().node
    ends = {end.topic_name: kind(end.msg_type) for end in (*node.publishers, *node.subscriptions)}
    layout = (ROOT / 'foxglove' / 'rigid_gns.json').read_text(encoding='utf-8')
    named = set(re.findall(r'"(/[\w/]+)(?:\.data)?"', layout))
    assert len(named) == 7
    assert named <= set(ends)
    rviz = (ROOT / 'rviz' / 'rigid_gns.rviz').read_text(encoding='utf-8')
    displays = re.findall(r'Class: rviz_default_plugins/(\w+Array)[^$]*?Value: ([\w/]+)', rviz)
    assert len(displays) == 4
    assert all(ends[f'/{topic}'].endswith(f'/{shown}') for shown, topic in displays)


def test_the_document_has_the_services(simulated: Simulated) -> None:
    node = simulated().node
    found = {
        service.srv_name: kind(service.srv_type)
        for service in node.services
        if not re.search('parameter|type_description|logger', service.srv_name)
        and not kind(service.srv_type).startswith('lifecycle_msgs/')
    }
    rows = {row[0].strip('`'): row[1] for row in cells('Services')}
    assert rows == found


def test_the_document_has_the_parameters(bench: Any) -> None:
    node = bench.add(SimulatorNode)
    found = []
    for name, parameter in node._parameters.items():
        if name.startswith(('qos_overrides.', 'use_sim_time', 'start_type_description')):
            continue
        descriptor, value = node.describe_parameter(name), parameter.value
        default = value if isinstance(value, (str, int, float)) else list(value)
        meaning = re.sub(r' \[[^]]+\]$', '', descriptor.description)
        changes = 'no' if descriptor.read_only else 'yes'
        found.append([f'`{name}`', f'`{default!r}`', span(descriptor), changes, meaning])
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        assert bool(descriptor.floating_point_range or descriptor.integer_range) == number
    assert len(found) == len(SIMULATOR)
    assert cells('Parameters') == found


def test_quality_of_service_can_be_overridden(bench: Any) -> None:
    names = {
        'qos_overrides./lab/tracked_poses.subscription.reliability': 'reliable',
        'qos_overrides./lab/tracked_poses.subscription.depth': 20,
        'qos_overrides./lab/predicted_poses.publisher.reliability': 'best_effort',
        'qos_overrides./lab/predicted_poses.publisher.depth': 1,
    }
    node = bench.add(SimulatorNode, remap=('__ns:=/lab',), **names)
    topics = node.simulation.topics
    (tracked,) = node.get_subscriptions_info_by_topic('/lab/tracked_poses')
    assert tracked.qos_profile.reliability == ReliabilityPolicy.RELIABLE
    (predicted,) = node.get_publishers_info_by_topic('/lab/predicted_poses')
    assert predicted.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    assert topics.names['start'] == '/lab/simulator/start'
    assert topics.names['diagnostics'] == '/diagnostics'  # one for all nodes, as tools expect
    assert node.describe_parameter(next(iter(names))).read_only


def test_a_wrong_override_is_named_and_leaves_no_bag(bench: Any, tmp_path: Path) -> None:
    name, bag = 'qos_overrides./tracked_poses.subscription.reliability', tmp_path / 'bag'
    with pytest.raises(ValueError, match='qos_overrides of tracked_poses: .*sometimes'):
        bench.add(SimulatorNode, record=str(bag), **{name: 'sometimes'})
    assert not bag.exists()  # so that the same command, corrected, can be given


# --- gravity ---


@pytest.mark.parametrize('direction', [(0, 1, 0), (0, -2.5, 0), (1, 2, 3), (0, 0, 1)])
def test_gravity_of_any_direction_turns_the_prediction(
    tmp_path: Path, direction: tuple[float, ...]
) -> None:
    """In a frame that is turned, the same spheres bounce on the same floor."""
    unit = np.asarray(direction) / np.linalg.norm(direction)
    _, quaternion = _upright(-unit)
    back = quaternion * [-1.0, -1.0, -1.0, 1.0]

    def seen(vectors: np.ndarray) -> np.ndarray:
        """Vectors of the upright frame in the turned one."""
        pure = np.concatenate([vectors, np.zeros((*vectors.shape[:-1], 1))], axis=-1)
        return quaternion_multiply(quaternion_multiply(back, pure), quaternion)[..., :3]

    floor = seen(np.array([0.0, 0.0, 1.0])).tolist()
    scene = tmp_path / 'floor.yaml'
    scene.write_text(f'scene: {{surfaces: [{{point: [0.0, 0.0, 0.0], normal: {floor}}}]}}\n')
    model = Forecaster('', with_gravity_along(load_scene(scene), direction))
    np.testing.assert_allclose(model.scene.gravity, 9.81 * unit, atol=1e-12)
    assert model.level
    upright = Forecaster('', Scene())
    # not where rounding decides whether a sphere that leaves the floor still touches it
    positions = np.array([[0.0, 0.0, 1.3], [0.6, 0.8, 3.4]])
    turned = model.forecast(State(positions=seen(positions)), 0)
    straight = upright.forecast(State(positions=positions), 0)
    for index in range(1, 11):
        expected = seen(straight.advance_to(index * DT).poses[:, :3])
        np.testing.assert_allclose(turned.advance_to(index * DT).poses[:, :3], expected, atol=1e-6)


def test_a_scene_without_gravity_has_none_to_turn() -> None:
    with pytest.raises(ValueError, match='the scene has no gravity'):
        with_gravity_along(Scene(gravity=0.0), (0.0, 1.0, 0.0))
    assert with_gravity_along(Scene(gravity=0.0), (0.0, 0.0, 0.0)) == Scene(gravity=0.0)


def test_the_published_scene_has_the_turned_gravity(
    simulated: Simulated, log: Callable[[], str]
) -> None:
    setup = simulated(gravity_direction=[0.0, 2.0, 0.0])
    model = setup.node.simulation._model
    assert model.description['scene']['gravity'] == [0.0, 9.81, 0.0]
    assert model.description['scene']['surfaces'] == load_scene('box_154').to_mapping()['surfaces']
    assert setup.node.simulation.window.settings.environment.gravity.tolist() == [0.0, 9.81, 0.0]
    # walls of the box carry spheres now
    assert 'no surface is level' not in log()


def test_surfaces_of_another_frame_are_warned_of(
    simulated: Simulated, log: Callable[[], str]
) -> None:
    simulated(gravity_direction=[1.0, 1.0, 0.0])
    assert 'are gravity and surfaces given in the same frame?' in log()


@pytest.mark.parametrize('value', [[0.0, 1.0], [0.0, float('nan'), 1.0]])
def test_a_bad_direction_is_refused(bench: Any, value: list[float]) -> None:
    with pytest.raises(ValueError, match='gravity_direction is .*allowed: 3 finite numbers'):
        bench.add(SimulatorNode, gravity_direction=value)


def test_a_direction_of_integers_is_refused_with_a_remedy(bench: Any) -> None:
    with pytest.raises(ValueError, match=r'give 3 floats, as \[0.0, 0.0, 0.0\]'):
        bench.add(SimulatorNode, gravity_direction=[0, 0, -1])


def test_properties_per_sphere_follow_the_ids() -> None:
    scene = Scene(radius=(1.0, 2.0, 3.0), mass=5.0)
    assert scene_of(scene, (2, 0)).radius == (3.0, 1.0)
    assert scene_of(scene, (0, 1, 2)) is scene and scene_of(Scene(), (7, 9)) == Scene()
    with pytest.raises(ValueError, match='sphere 3 has no properties'):
        scene_of(scene, (0, 3))


# --- threads ---


@pytest.mark.parametrize('threads', [1, 2])
def test_threads_are_bounded(simulated: Simulated, threads: int) -> None:
    simulated(threads=threads)
    assert {pool['num_threads'] for pool in threadpool_info()} == {threads}
    torch = pytest.importorskip('torch', reason='torch is not installed')
    simulated(threads=1)
    assert torch.get_num_threads() == 1


def test_the_engine_has_no_parallel_loops() -> None:
    """So that Numba starts no threads of its own."""
    folder = ROOT / 'rigid_gns_core' / 'engine'
    texts = ''.join(path.read_text(encoding='utf-8') for path in folder.glob('*.py'))
    assert not re.search(r'\bprange\b|\bparallel *=', texts)


def test_parameters_are_checked_before_any_is_applied(simulated: Simulated) -> None:
    node = simulated().node
    results = node.set_parameters_atomically(
        [Parameter('horizon', value=1.0), Parameter('start', value='sometimes')]
    )
    assert not results.successful and node.simulation.futures.seconds == 0.0
    results = node.set_parameters_atomically(
        [
            Parameter('horizon', value=1.0),
            Parameter('start', value='diverged'),
            Parameter('resync_error', value=2.0),
            Parameter('resync_over', value='mean'),
        ]
    )
    assert results.successful and node.simulation.futures.seconds == 1.0
    resync = node.simulation.predictor.resync
    assert (resync.start, resync.bound, resync.over) == ('diverged', 2.0, 'mean')
