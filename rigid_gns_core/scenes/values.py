# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of single values."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import shown, UserError


def checked_number(
    name: str, value: Any, low: float = 0.0, high: float = np.inf, *, above: bool = False
) -> float:
    """Finite number in a range.

    Args:
        name: For the message.
        value: The number.
        low: Least value.
        high: Largest value.
        above: Whether the least value itself is refused.

    Raises:
        UserError: It is none, or out of range.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise UserError(f'{name} is {shown(value)}, expected a number') from None
    inside = low < number <= high if above else low <= number <= high
    if not (inside and np.isfinite(number)):
        bound = f'{"greater than" if above else "at least"} {low:g}'
        bound += ' and finite' if high == np.inf else f' and at most {high:g}'
        raise UserError(f'{name} is {number:g}, expected {bound}')
    return number
