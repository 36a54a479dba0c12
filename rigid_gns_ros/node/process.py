# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A node as a process: signals, exit codes, and errors in one line.

rclpy and the nodes take a second to import, in which a signal may come. So `run_node` installs its
handlers first and imports them afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches
import gc
import os
import signal
import sys
import threading
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rclpy.node import Node

    from .closing_node import ClosingNode


OF_RCLPY = ('use_sim_time', 'start_type_description_service')
"""Parameters that rclpy itself declares."""


class Finished(Exception):
    """Raised in a callback by a node that has finished."""


def run_node(name: str, load: Callable[[], Callable[[], ClosingNode]]) -> int:
    """Create a node and run it until it has finished, or until SIGINT, SIGTERM or SIGHUP.

    Args:
        name: Name of the node, for the log.
        load: Imports the node and returns what creates it.

    Returns:
        The exit code: 0, or 1 where the node cannot be created or an argument is unknown.
    """
    up = False

    def leave(*_: object) -> None:
        # rclpy's own handlers end the spinning. Python's would also raise KeyboardInterrupt, and
        # the second SIGINT of a Ctrl-C under `ros2 launch` would hit while the bag is closed
        if not up:
            os._exit(0)  # nothing has begun that must be finished

    signal.signal(signal.SIGINT, leave)
    signal.signal(signal.SIGTERM, leave)
    _terminate_on_hangup()
    import rclpy
    from rclpy.exceptions import NameValidationException, ParameterException
    from rclpy.executors import ExternalShutdownException
    from rclpy.impl.implementation_singleton import rclpy_implementation
    from rclpy.logging import get_logger
    from rclpy.utilities import remove_ros_args
    from rigid_gns_core.errors import UserError

    from .executor import QuickExecutor

    unusable = (
        *(UserError, OSError, ImportError, ParameterException, NameValidationException),
        rclpy_implementation.RCLError,  # a bad argument after --ros-args
        rclpy_implementation.UnknownROSArgsError,
    )
    node = None
    try:
        if words := remove_ros_args(sys.argv)[1:]:
            return _answer(name, words)
        make = load()
        rclpy.init()
        up = True
        executor = QuickExecutor()
        node = make()
        _warn_of_unknown(node)
        # these objects stay: a collection of all of them would take a tenth of a second
        gc.collect()
        gc.freeze()
        rclpy.spin(node, executor)
    except (ExternalShutdownException, Finished):
        pass
    except Exception as error:
        if up and not rclpy.ok():
            return 0  # a signal came while the node was created, or within a callback
        if node is None and isinstance(error, unusable):
            unknown = isinstance(error, rclpy_implementation.UnknownROSArgsError)
            text = f'unknown words after --ros-args: {error}' if unknown else str(error)
            get_logger(name).fatal(' '.join(text.split()))
            return 1
        raise
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        if node is not None:
            node.close()
        rclpy.try_shutdown()
    return 0


def _answer(name: str, words: list[str]) -> int:
    """Print help or an error for arguments that are not ROS'; the exit code."""
    if '-h' in words or '--help' in words:
        print(f'usage: {name} --ros-args -p NAME:=VALUE ...; parameters: docs/node.md', flush=True)
        return 0
    print(
        f'{name}: error: unknown arguments: {" ".join(words)}; '
        'parameters are given as --ros-args -p NAME:=VALUE',
        file=sys.stderr,
    )
    return 1


def _warn_of_unknown(node: Node) -> None:
    """Warn of parameters that the node does not declare, which rclpy ignores."""
    known = [name for name in node.list_parameters([], 0).names if name not in OF_RCLPY]
    for name in node._parameter_overrides:  # there is no public access
        if name in OF_RCLPY or name in known or name.startswith('qos_overrides.'):
            continue
        near = get_close_matches(name, known)
        node.get_logger().warning(
            f'parameter {name} is ignored: this node has none of that name'
            + (f'; nearest: {", ".join(near)}' if near else '')
        )


def _terminate_on_hangup() -> None:
    """Turn a SIGHUP into a SIGTERM, which rclpy handles; not under nohup."""
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        return
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})  # inherited by all later threads

    def wait() -> None:
        signal.sigwait({signal.SIGHUP})
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=wait, name='hangup', daemon=True).start()
