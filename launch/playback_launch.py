# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plays the tracked poses of a bag to the simulator, on simulated time.

ros2 launch rigid_gns_ros playback_launch.py bag:=my_bag scene:=my_scene.yaml

The bag begins when the simulator is ready, and all ends with the bag.
"""

from launch import Action, LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    GroupAction,
    IncludeLaunchDescription,
    OpaqueFunction,
    RegisterEventHandler,
    Shutdown,
)
from launch.event_handlers import OnProcessExit, OnProcessIO
from launch.events.process import ProcessExited, ProcessIO
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

# passed on to simulator_launch.py: default, meaning
PASSED = {
    'namespace': ('', 'namespace of the simulator and its topics'),
    'model': ('', "name or path of the model; empty: the parameter file's"),
    'scene': ('', "name of a shipped scene, or a YAML file; empty: the parameter file's"),
    'record': ('', 'folder of the bag to write; must not exist; empty: no recording'),
    'start': ('', "first, every or diverged; empty: the parameter file's"),
    'horizon': ('', "length of predicted trajectories [s]; empty: the parameter file's"),
    'predicted_poses': ('', 'topic instead of predicted_poses'),
    'log_level': ('', 'of the simulator: debug, info, warn, error or fatal'),
}
# what the simulator logs when it is ready; its first start compiles for minutes before
READY = b'ready: '


class Playback:
    """Plays the bag once the simulator is ready, and ends the launch with it."""

    def __init__(self) -> None:
        names = ('bag', 'topic', 'rate', 'delay')
        bag, topic, rate, delay = (LaunchConfiguration(name) for name in names)
        command = ['ros2', 'bag', 'play', bag, '--topics', topic, '--clock', '100']
        self.play = ExecuteProcess(
            cmd=[*command, '--rate', rate, '--delay', delay], output='screen'
        )
        self._begun = False

    def on_output(self, event: ProcessIO) -> list[Action] | None:
        """Begin at the line by which the simulator says that it is ready."""
        if self._begun or READY not in event.text:
            return None
        self._begun = True
        return [self.play]

    def on_exit(self, event: ProcessExited, _: LaunchContext) -> list[Action]:
        """End all, whichever process has ended: the other has nothing left to do."""
        played = event.action is self.play
        return [Shutdown(reason='the bag is played' if played else 'the simulator has ended')]


def playback(_: LaunchContext) -> list[Action]:
    both = Playback()
    return [
        RegisterEventHandler(OnProcessIO(on_stdout=both.on_output, on_stderr=both.on_output)),
        RegisterEventHandler(OnProcessExit(on_exit=both.on_exit)),
    ]


def generate_launch_description() -> LaunchDescription:
    share = FindPackageShare('rigid_gns_ros')
    arguments = {
        'topic': ('/tracked_poses', 'topic of tracked poses in it'),
        'rate': ('1.0', 'playback speed, relative to the recording'),
        'delay': ('1.0', 'time from the ready simulator to the first message [s]'),
        'params_file': (
            PathJoinSubstitution([share, 'config', 'simulator.yaml']),
            "YAML file of the simulator's parameters",
        ),
        **PASSED,
    }
    passed = [(name, LaunchConfiguration(name)) for name in ('params_file', *PASSED)]
    passed += [('use_sim_time', 'true'), ('tracked_poses', LaunchConfiguration('topic'))]
    simulator = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(
            PathJoinSubstitution([share, 'launch', 'simulator_launch.py'])
        ),
        launch_arguments=passed,
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument('bag', description='folder of the bag to play'),
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, (default, text) in arguments.items()
            ),
            OpaqueFunction(function=playback),
            GroupAction([simulator]),  # whose arguments end with it
        ]
    )
