"""Learned simulators of rigid spheres: scenes, trajectories and prediction. No ROS in here."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from .scene import Plane, Scene
from .state import State, Trajectory

if TYPE_CHECKING:
    from .rollout import Rollout, Simulator, load_simulator

__all__ = ['Plane', 'Rollout', 'Scene', 'Simulator', 'State', 'Trajectory', 'load_simulator']

# Imported when first asked for (PEP 562): models take longer to load than a scene.
_LAZY = {'Rollout', 'Simulator', 'load_simulator'}


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(importlib.import_module('.rollout', __name__), name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')


def __dir__() -> list[str]:
    return sorted(__all__)
