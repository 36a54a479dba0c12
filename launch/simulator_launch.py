# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Starts the simulator: `ros2 launch rigid_gns_ros simulator_launch.py scene:=my_scene.yaml`."""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

# launch arguments that override the parameter file where they are not empty: type, meaning
PARAMETERS = {
    'model': (str, 'name or path of the model'),
    'scene': (str, 'name of a shipped scene, or a YAML file'),
    'record': (str, 'folder of the bag to write; must not exist'),
    'start': (str, 'first, every or diverged: when the prediction starts anew'),
    'horizon': (float, 'how far ahead a trajectory is predicted from each tracked frame [s]'),
    'use_sim_time': (bool, 'true: time is that on /clock'),
}
# launch arguments that rename a topic
TOPICS = ('tracked_poses', 'predicted_poses')


def typed(name: str, value: str, kind: type) -> object:
    """The value of an argument as its parameter wants it."""
    if kind is str:  # else a name such as 1e3 would become a number
        return ParameterValue(value, value_type=str)
    known = {'true': True, 'false': False}
    try:
        return known[value.lower()] if kind is bool else kind(value)
    except (KeyError, ValueError):
        wanted = 'true or false' if kind is bool else 'a number'
        raise RuntimeError(f'{name} is {value!r}, expected {wanted}') from None


def nodes(context: LaunchContext) -> list[Node]:
    def given(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    params_file = Path(given('params_file')).expanduser()
    if not params_file.is_file():  # launch_ros would go on without it
        raise RuntimeError(f'params_file is {str(params_file)!r}: no such file')
    overrides = {
        name: typed(name, given(name), kind)
        for name, (kind, _) in PARAMETERS.items()
        if given(name)
    }
    level = given('log_level')
    return [
        Node(
            package='rigid_gns_ros',
            executable='simulator',
            namespace=LaunchConfiguration('namespace'),
            parameters=[str(params_file), *([overrides] if overrides else [])],
            remappings=[(name, given(name)) for name in TOPICS if given(name)],
            arguments=['--ros-args', '--log-level', level] if level else [],
            output='screen',
        )
    ]


def generate_launch_description() -> LaunchDescription:
    params_file = PathJoinSubstitution(
        [FindPackageShare('rigid_gns_ros'), 'config', 'simulator.yaml']
    )
    texts = {name: text for name, (_, text) in PARAMETERS.items()}
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
                for name, text in texts.items()
            ),
            *(
                DeclareLaunchArgument(
                    name, default_value='', description=f'topic instead of {name}'
                )
                for name in TOPICS
            ),
            DeclareLaunchArgument(
                'log_level', default_value='', description='debug, info, warn, error or fatal'
            ),
            OpaqueFunction(function=nodes),
        ]
    )
