# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The scene's surfaces on ~/surfaces, for RViz2 and Foxglove."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rclpy.qos import DurabilityPolicy, QoSProfile
from rigid_gns_ros.node.simulator import SimulatorNode
from visualization_msgs.msg import Marker, MarkerArray

ROOT = Path(__file__).resolve().parents[3]
SCENE = {
    'scene': {
        'radius': 0.02,
        'surfaces': [
            {},
            {
                'point': [0.0, 0.0, 0.5],
                'normal': [0.6, 0.0, 0.8],
                'length_x': 2.0,
                'length_y': 1.0,
            },
        ],
    }
}


def test_a_late_listener_gets_all_surfaces(bench: Any, tmp_path: Path) -> None:
    (tmp_path / 'scene.yaml').write_text(yaml.safe_dump(SCENE))
    node = bench.add(SimulatorNode, scene=str(tmp_path / 'scene.yaml'), frame_id='lab')
    heard: list[MarkerArray] = []
    profile = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    bench.tester.create_subscription(MarkerArray, '/simulator/surfaces', heard.append, profile)
    bench.until(lambda: heard, 'the surfaces')
    ground, plate = heard[0].markers
    for marker in ground, plate:
        assert (marker.type, marker.ns) == (Marker.TRIANGLE_LIST, 'surfaces')
        assert marker.header.frame_id == 'lab'
        assert (marker.lifetime.sec, marker.lifetime.nanosec) == (0, 0)  # it stays
        assert (marker.scale.x, marker.scale.y, marker.scale.z) == (1.0, 1.0, 1.0)
        assert len(marker.points) == 6 and marker.color.a > 0
    corners = np.array([[p.x, p.y, p.z] for p in plate.points])
    area = 0.5 * np.linalg.norm(
        np.cross(corners[1::3] - corners[::3], corners[2::3] - corners[::3]), axis=1
    )
    assert area.sum() == pytest.approx(2.0)  # 2 m by 1 m
    # all in the plane through its point
    assert np.abs((corners - [0.0, 0.0, 0.5]) @ [0.6, 0.0, 0.8]).max() < 1e-12
    # the ground is cut, but reaches 20 radii beyond the points of all surfaces
    flat = np.array([[p.x, p.y, p.z] for p in ground.points])
    assert np.isfinite(flat).all() and np.abs(flat[:, 2]).max() < 1e-12
    assert (flat.min(axis=0)[:2] <= -0.4).all() and (flat.max(axis=0)[:2] >= 0.4).all()
    assert node.simulation.topics.surfaces.topic_name == '/simulator/surfaces'


def test_the_layouts_show_them() -> None:
    shown = yaml.safe_load((ROOT / 'rviz' / 'rigid_gns.rviz').read_text())
    displays = {one['Name']: one for one in shown['Visualization Manager']['Displays']}
    topic = displays['Surfaces']['Topic']
    assert (topic['Value'], topic['Durability Policy']) == (
        'simulator/surfaces',
        'Transient Local',
    )
    layout = json.loads((ROOT / 'foxglove' / 'rigid_gns.json').read_text())
    assert layout['configById']['3D!rigid_gns']['topics']['/simulator/surfaces']['visible']


def test_no_transform_is_published_and_the_document_says_why(bench: Any) -> None:
    """Where the tracker's frame stands in the lab is not the node's to say."""
    node = bench.add(SimulatorNode)
    names = {publisher.topic_name for publisher in node.publishers}
    assert names and names.isdisjoint({'/tf', '/tf_static'})
    text = (ROOT / 'docs' / 'node.md').read_text()
    assert '**What `world` is.**' in text
    assert 'static_transform_publisher --frame-id map --child-frame-id world' in text
