# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Kinds of trackers that a parameter chooses, and the names of their balls."""

from __future__ import annotations

from ..errors import UserError
from ..messages.object_arrays import OBJECT_ARRAYS

# each ball is a topic, or a frame of tf, which must be named
SINGLE = ('PoseStamped', 'PointStamped', 'tf')
TRACKERS = ('', *SINGLE, *OBJECT_ARRAYS)


def names_of(text: str) -> tuple[str, ...]:
    """Names that commas divide.

    Raises:
        UserError: A name is given twice, or is empty.
    """
    names = tuple(name.strip() for name in text.split(',')) if text.strip() else ()
    for name in names:
        if not name or names.count(name) > 1:
            wrong = 'twice' if name else 'empty'
            raise UserError(
                f'balls is {text!r}, in which a name is {wrong}; expected each ball once, as in '
                "'ball_1, ball_2'"
            )
    return names


def balls_of(text: str, tracker: str) -> tuple[str, ...]:
    """Names of the balls of a tracker, parameters `balls` and `tracker`.

    Raises:
        UserError: They do not fit each other.
    """
    names = names_of(text)
    if tracker in SINGLE and not names:
        what = 'frames of tf' if tracker == 'tf' else 'topics'
        raise UserError(
            f'parameter tracker is {tracker!r}, but balls is empty; name the {what} of the balls, '
            "as in 'ball_1, ball_2'"
        )
    if names and not tracker:
        raise UserError(
            f"parameter balls is {text!r}, but tracker is ''; choose one of "
            f'{", ".join(TRACKERS[1:])}, as PoseArray, PointCloud2 and single poses have no names'
        )
    return names
