# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What both nodes have in common: an end."""

from __future__ import annotations

from abc import ABC, abstractmethod

from rclpy.logging import get_logger
from rclpy.node import Node


class ClosingNode(Node, ABC):
    """A node with something to finish at its end."""

    @abstractmethod
    def close(self) -> None:
        """Finish; ROS may be down already."""


def log_end(text: str) -> None:
    """Log when ROS may be down already, so that a node's own logger cannot publish it."""
    get_logger('rigid_gns_ros').info(text)
