# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`ros2 run rigid_gns_ros tracker`: a stand-in for a real tracker, from a record or Bullet."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from .node.process import run_node

if TYPE_CHECKING:
    from .node.tracker import TrackerNode


def main() -> int:
    """Run the node until its record ends or a signal; the exit code."""
    return run_node('tracker', _load)


def _load() -> type[TrackerNode]:
    from .node.tracker import TrackerNode

    return TrackerNode


if __name__ == '__main__':
    sys.exit(main())
