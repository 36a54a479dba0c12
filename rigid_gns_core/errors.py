# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a user did wrong, told from a bug: the command line shows the first without a traceback."""

from __future__ import annotations


class UserError(ValueError):
    """Input that cannot be used; the message names the offender, the bound and the remedy."""
