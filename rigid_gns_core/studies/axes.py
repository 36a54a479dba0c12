# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Common style of the axes of all charts."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK, SPINE, GRID = '#333333', '#8c8c8c', '#e6e6e6'


def clean_axes(axes: Axes, label_size: int = 9) -> None:
    """Style axes without a box; `label_size` in points."""
    for side in ('top', 'right'):
        axes.spines[side].set_visible(False)
    for side in ('left', 'bottom'):
        axes.spines[side].set_color(SPINE)
    axes.tick_params(colors=INK, labelsize=label_size)
