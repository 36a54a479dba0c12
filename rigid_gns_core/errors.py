# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The error for what a user did wrong: the command line shows it without a traceback."""

from __future__ import annotations


class UserError(ValueError):
    """Input that cannot be used; the message names the offender, the bound and the remedy."""
