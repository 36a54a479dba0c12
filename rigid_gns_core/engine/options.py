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

"""What a user may choose of a model that is loaded."""

from __future__ import annotations

from dataclasses import dataclass

from ..files.config import check_least


@dataclass(frozen=True)
class LawsOptions:
    """What a user may change of the laws; for measurements rather than for use.

    Args:
        guard: Hold the energy of every island down.
        sleep: Let islands at rest sleep.
        substeps: K, substeps of a frame in which something may touch.
        rounds: M, rounds of the contact solver in a substep.
    """

    guard: bool = True
    sleep: bool = True
    substeps: int = 8
    rounds: int = 4

    def __post_init__(self) -> None:
        check_least(self, 1, 'substeps', 'rounds')
