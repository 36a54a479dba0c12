# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Base class of the nodes, which are closed at their end."""

from __future__ import annotations

from abc import ABC, abstractmethod

from rclpy.logging import get_logger
from rclpy.node import Node


class ClosingNode(Node, ABC):
    """A node that is closed at its end."""

    @abstractmethod
    def close(self) -> None:
        """Finish the work; ROS may be shut down already."""


def log_end(text: str) -> None:
    """Log a line after ROS may have been shut down, when a node's logger fails to publish."""
    get_logger('rigid_gns_ros').info(text)
