# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of values that a user gives."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import shown, UserError

TOO_LARGE = 'a number too large for a double, 1.8e308'
"""What an integer of hundreds of digits is."""


def checked_floats(name: str, value: Any) -> NDArray[np.float64]:
    """Numbers as an array of any shape, which may be `value` itself.

    Raises:
        UserError: A double does not hold them, they are none, or rows differ in length.
    """
    try:
        return np.asarray(value, dtype=np.float64)
    except OverflowError:
        raise UserError(f'{name} is {TOO_LARGE}') from None
    except (TypeError, ValueError):
        raise UserError(f'{name} is {shown(value)}, expected numbers') from None


def checked_whole(name: str, value: Any, low: int, high: int | None = None) -> int:
    """Whole number, which may be a float, from `low` to `high`; None: without end.

    Raises:
        UserError: It is none, or out of range.
    """
    try:
        whole = int(value)
        right = whole == float(value) and whole >= low and (high is None or whole <= high)
    except (TypeError, ValueError, OverflowError, np.ma.MaskError):
        right = False
    if not right or isinstance(value, str):
        bound = f'{low} or more' + ('' if high is None else f' and at most {high}')
        raise UserError(f'{name} is {shown(value)}, expected a whole number, {bound}')
    return whole


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
    except OverflowError:
        raise UserError(f'{name} is {TOO_LARGE}') from None
    inside = low < number <= high if above else low <= number <= high
    if not (inside and np.isfinite(number)):
        bound = f'{"greater than" if above else "at least"} {low:g}'
        bound += ' and finite' if high == np.inf else f' and at most {high:g}'
        raise UserError(f'{name} is {number:g}, expected {bound}')
    return number
