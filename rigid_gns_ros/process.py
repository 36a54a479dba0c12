"""A node as a process: signals, exit codes, and errors in one line."""

from __future__ import annotations

import os
import signal
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.utilities import ok, try_shutdown


class Finished(Exception):
    """Raised in a callback when a node has nothing left to do."""


class ClosingNode(Node, ABC):
    """A node with something to finish at its end."""

    @abstractmethod
    def close(self) -> None:
        """Finish; ROS may be down already."""


def log_end(text: str) -> None:
    """Log when ROS may be down already, so that a node's own logger cannot publish it."""
    get_logger('rigid_gns_ros').info(text)


def run_node(name: str, make: Callable[[], ClosingNode]) -> int:
    """Make a node and run it until it has finished, or until SIGINT, SIGTERM or SIGHUP.

    Returns:
        The exit code: 0, or 1 where the node could not be made.
    """
    # rclpy's own handlers end the spinning; Python's would also raise KeyboardInterrupt, which at
    # the second SIGINT of a Ctrl-C under `ros2 launch` would strike while the bag is closed
    signal.signal(signal.SIGINT, lambda *_: None)
    _terminate_on_hangup()
    rclpy.init()
    executor = SingleThreadedExecutor()
    node = None
    try:
        node = make()
        rclpy.spin(node, executor)
    except (ExternalShutdownException, Finished):
        pass
    except Exception as error:
        if not ok():
            return 0  # a signal came while the node was being made, or within a callback
        if node is None and isinstance(error, (ValueError, OSError, ImportError)):
            get_logger(name).fatal(' '.join(str(error).split()))
            return 1
        raise
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        if node is not None:
            node.close()
        try_shutdown()
    return 0


def _terminate_on_hangup() -> None:
    """Make a SIGHUP a SIGTERM, as rclpy knows how to end at that one only; not under nohup."""
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        return
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})  # in all threads to come

    def wait() -> None:
        signal.sigwait({signal.SIGHUP})
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=wait, name='hangup', daemon=True).start()
