# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracks of spheres from frames of poses that carry no identity: association and velocities."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from .state_estimate import estimate_state, StateEstimate

__all__ = ['StateEstimate', 'estimate_state']


def __getattr__(name: str) -> Any:
    # when first asked for (PEP 562): it loads compiled code
    if name in __all__:
        from . import state_estimate

        return getattr(state_estimate, name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
