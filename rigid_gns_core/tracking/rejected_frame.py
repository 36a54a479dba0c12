# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The error of a tracked frame that cannot be used."""

from __future__ import annotations

from ..errors import UserError


class RejectedFrame(UserError):
    """A tracked frame cannot be used. `kind` names the check that failed."""

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(message)
        self.kind = kind
