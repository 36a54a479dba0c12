# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""`ros2 run rigid_gns_ros simulator`: tracked poses in, predicted poses out, in real time."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from .node.process import run_node

if TYPE_CHECKING:
    from .node.simulator import SimulatorNode


def main() -> int:
    """Run the node until a signal comes; returns the exit code."""
    return run_node('simulator', _load)


def _load() -> type[SimulatorNode]:
    from .node.simulator import SimulatorNode

    return SimulatorNode


if __name__ == '__main__':
    sys.exit(main())
