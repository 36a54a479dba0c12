# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulators of rigid spheres: scenes, trajectories and prediction. No ROS in here."""

from __future__ import annotations

import importlib
from typing import Any, TYPE_CHECKING

from .errors import UserError

if TYPE_CHECKING:
    from .prediction.load import load_simulator
    from .rollout.rollout import Rollout
    from .rollout.simulator import Simulator
    from .scenes.air import Air
    from .scenes.contact_law import ContactLaw, RestitutionCurve
    from .scenes.obstacle import Obstacle
    from .scenes.plane import Plane
    from .scenes.scene import Scene
    from .scenes.scene_file import load_scene
    from .scenes.state import State, Trajectory

__all__ = [
    'Air',
    'ContactLaw',
    'Obstacle',
    'Plane',
    'RestitutionCurve',
    'Rollout',
    'Scene',
    'Simulator',
    'State',
    'Trajectory',
    'UserError',
    'load_scene',
    'load_simulator',
]

# Imported when first asked for (PEP 562): commands answer Ctrl-C before anything heavy is loaded.
_LAZY = {
    'Air': '.scenes.air',
    'ContactLaw': '.scenes.contact_law',
    'Obstacle': '.scenes.obstacle',
    'Plane': '.scenes.plane',
    'RestitutionCurve': '.scenes.contact_law',
    'Rollout': '.rollout.rollout',
    'Scene': '.scenes.scene',
    'Simulator': '.rollout.simulator',
    'State': '.scenes.state',
    'Trajectory': '.scenes.state',
    'load_scene': '.scenes.scene_file',
    'load_simulator': '.prediction.load',
}


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(importlib.import_module(_LAZY[name], __name__), name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')


def __dir__() -> list[str]:
    return sorted(__all__)
