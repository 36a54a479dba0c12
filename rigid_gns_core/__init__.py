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

"""Learned simulators of rigid spheres: scenes, trajectories and prediction. No ROS in here."""

from __future__ import annotations

import importlib
from typing import Any, TYPE_CHECKING

from .errors import UserError
from .scenes.plane import Plane
from .scenes.scene import Scene
from .scenes.scene_file import load_scene
from .scenes.state import State, Trajectory

if TYPE_CHECKING:
    from .prediction.load import load_simulator
    from .rollout.rollout import Rollout
    from .rollout.simulator import Simulator

__all__ = [
    'Plane',
    'Rollout',
    'Scene',
    'Simulator',
    'State',
    'Trajectory',
    'UserError',
    'load_scene',
    'load_simulator',
]

# Imported when first asked for (PEP 562): models take longer to load than a scene.
_LAZY = {
    'Rollout': '.rollout.rollout',
    'Simulator': '.rollout.simulator',
    'load_simulator': '.prediction.load',
}


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(importlib.import_module(_LAZY[name], __name__), name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')


def __dir__() -> list[str]:
    return sorted(__all__)
