# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`ros2 run rigid_gns_ros simulator`: predicts tracked poses in real time."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from .node.process import run_node

if TYPE_CHECKING:
    from .node.simulator import SimulatorNode


def main() -> int:
    """Run the node until a signal; the exit code."""
    return run_node('simulator', _load)


def _load() -> type[SimulatorNode]:
    # before ROS begins: what compiles for two minutes must end by a signal, and rclpy's handlers
    # only ask for it
    from rigid_gns_core.engine import stepper
    from rigid_gns_core.tracking import warm

    stepper.warm_up()
    warm.warm_up()
    from .node.simulator import SimulatorNode

    return SimulatorNode


if __name__ == '__main__':
    sys.exit(main())
