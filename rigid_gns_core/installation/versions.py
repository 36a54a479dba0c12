# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Versions of what is installed, from its metadata: nothing is imported."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import metadata

PACKAGE = 'rigid_gns_ros'
"""Name under which both packages are installed."""


def version_of(name: str) -> str | None:
    """Version of a distribution; None: it is not installed."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def versions_of(names: Iterable[str]) -> dict[str, str | None]:
    """Version of each distribution."""
    return {name: version_of(name) for name in names}
