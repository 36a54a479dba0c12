# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Starts the simulator: `ros2 launch rigid_gns_ros simulator_launch.py scene:=my_scene.yaml`."""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

# launch arguments that override the parameter file
PARAMETERS = {
    'model': 'name or path of the model',
    'scene': 'name of a shipped scene, or a YAML file',
    'record': 'folder of the bag to write; must not exist',
}


def nodes(context: LaunchContext) -> list[Node]:
    given = {name: LaunchConfiguration(name).perform(context) for name in PARAMETERS}
    overrides = {
        name: ParameterValue(value, value_type=str) for name, value in given.items() if value
    }
    return [
        Node(
            package='rigid_gns_ros',
            executable='simulator',
            namespace=LaunchConfiguration('namespace'),
            parameters=[LaunchConfiguration('params_file'), *([overrides] if overrides else [])],
            output='screen',
        )
    ]


def generate_launch_description() -> LaunchDescription:
    params_file = PathJoinSubstitution(
        [FindPackageShare('rigid_gns_ros'), 'config', 'simulator.yaml']
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'params_file', default_value=params_file, description='YAML file of parameters'
            ),
            DeclareLaunchArgument(
                'namespace', default_value='', description='namespace of the node and its topics'
            ),
            *(
                DeclareLaunchArgument(
                    name, default_value='', description=f"{text}; empty: the parameter file's"
                )
                for name, text in PARAMETERS.items()
            ),
            OpaqueFunction(function=nodes),
        ]
    )
