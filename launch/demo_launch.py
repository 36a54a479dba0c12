# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Starts the tracker with the shipped record, and the simulator: `make demo` without report."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

# passed on to simulator_launch.py: default, meaning
PASSED = {
    'namespace': ('', 'namespace of both nodes and their topics'),
    'model': ('', "name or path of the model; empty: the parameter file's"),
    'scene': ('box_154', 'shipped scene or YAML file, for the simulator and a live tracker'),
    'record': ('', 'folder of the bag to write; must not exist; empty: no recording'),
    'start': ('', "first, every or diverged; empty: the parameter file's"),
    'horizon': ('', "length of predicted trajectories [s]; empty: the parameter file's"),
    'predicted_poses': ('', 'topic instead of predicted_poses'),
    'log_level': ('', 'of the simulator: debug, info, warn, error or fatal'),
}


def generate_launch_description() -> LaunchDescription:
    share = FindPackageShare('rigid_gns_ros')
    params_file = PathJoinSubstitution([share, 'config', 'simulator.yaml'])
    live = ParameterValue(LaunchConfiguration('live'), value_type=bool)
    scene = ParameterValue(LaunchConfiguration('scene'), value_type=str)
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'params_file',
                default_value=params_file,
                description="YAML file of the simulator's parameters",
            ),
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, (default, text) in PASSED.items()
            ),
            DeclareLaunchArgument(
                'live', default_value='false', description='run Bullet live instead of a record'
            ),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(
                    PathJoinSubstitution([share, 'launch', 'simulator_launch.py'])
                ),
                launch_arguments=[
                    (name, LaunchConfiguration(name)) for name in ('params_file', *PASSED)
                ],
            ),
            Node(
                package='rigid_gns_ros',
                executable='tracker',
                namespace=LaunchConfiguration('namespace'),
                parameters=[{'live': live, 'scene': scene}],
                output='screen',
            ),
        ]
    )
