# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plays the tracked poses of a bag to the simulator, on simulated time.

ros2 launch rigid_gns_ros playback_launch.py bag:=my_bag scene:=my_scene.yaml
"""

from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    GroupAction,
    IncludeLaunchDescription,
)
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import SetParameter, SetRemap
from launch_ros.substitutions import FindPackageShare

# passed on to simulator_launch.py
PASSED = ('params_file', 'namespace', 'model', 'scene', 'record')


def generate_launch_description() -> LaunchDescription:
    share = FindPackageShare('rigid_gns_ros')
    defaults = {'params_file': PathJoinSubstitution([share, 'config', 'simulator.yaml'])}
    descriptions = {
        'params_file': "YAML file of the simulator's parameters",
        'namespace': 'namespace of the simulator and its topics',
        'model': "name or path of the model; empty: the parameter file's",
        'scene': "name of a shipped scene, or a YAML file; empty: the parameter file's",
        'record': 'folder of the bag to write; must not exist; empty: no recording',
    }
    topic = LaunchConfiguration('topic')
    play = ExecuteProcess(
        cmd=[
            'ros2',
            'bag',
            'play',
            LaunchConfiguration('bag'),
            '--topics',
            topic,
            '--clock',
            '100',
            '--rate',
            LaunchConfiguration('rate'),
            '--delay',  # the simulator loads its model first
            LaunchConfiguration('delay'),
        ],
        output='screen',
    )
    simulator = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(
            PathJoinSubstitution([share, 'launch', 'simulator_launch.py'])
        ),
        launch_arguments=[(name, LaunchConfiguration(name)) for name in PASSED],
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument('bag', description='folder of the bag to play'),
            DeclareLaunchArgument(
                'topic', default_value='/tracked_poses', description='topic of tracked poses in it'
            ),
            DeclareLaunchArgument(
                'rate',
                default_value='1.0',
                description='playback speed, relative to the recording',
            ),
            DeclareLaunchArgument(
                'delay', default_value='5.0', description='time before playback starts [s]'
            ),
            *(
                DeclareLaunchArgument(
                    name, default_value=defaults.get(name, ''), description=descriptions[name]
                )
                for name in PASSED
            ),
            GroupAction(
                [SetParameter('use_sim_time', True), SetRemap('tracked_poses', topic), simulator]
            ),
            play,
        ]
    )
