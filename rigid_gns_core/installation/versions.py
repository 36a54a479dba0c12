# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
