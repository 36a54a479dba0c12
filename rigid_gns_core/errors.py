# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The error for what a user did wrong: the command line shows it without a traceback."""

from __future__ import annotations

from reprlib import Repr
from typing import Any

_LONGEST = 100  # characters of a text

_SHORT = Repr()
_SHORT.maxstring, _SHORT.maxother, _SHORT.maxlong = _LONGEST, _LONGEST, 60
_SHORT.maxlevel, _SHORT.maxdict = 3, 8
_SHORT.maxlist = _SHORT.maxtuple = _SHORT.maxset = _SHORT.maxfrozenset = 12


class UserError(ValueError):
    """Input that cannot be used; the message names the offender, the bound and the remedy."""


def shown(value: Any) -> str:
    """Value for a message, cut where it is long: that of a file may be of any size."""
    try:
        text = _SHORT.repr(value)
    except ValueError:  # a whole number of more digits than Python prints
        text = f'a {type(value).__name__} too long to print'
    return text if len(text) <= 4 * _LONGEST else f'{text[: 3 * _LONGEST]}...{text[-_LONGEST:]}'
