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

"""One measured quantity against what closed forms say of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..scenes.state import Array


@dataclass(frozen=True)
class Check:
    """One measured quantity; `error` is relative to `expected` where that is not 0."""

    name: str
    case: str
    measured: float
    expected: float
    error: float
    bound: float

    @property
    def passed(self) -> bool:
        """Whether the error is within the bound; a value that is not finite is not."""
        return bool(abs(self.error) <= self.bound)


def check(
    name: str, case: str, measured: float | np.floating, expected: float, bound: float
) -> Check:
    """One quantity against what it should be."""
    error = (measured - expected) / abs(expected) if expected else measured
    return Check(name, case, float(measured), float(expected), float(error), bound)


def worst(name: str, cases: list[str], measured: Array, expected: Array, bound: float) -> Check:
    """Return the worst of several cases for all; measured and expected: shape (cases,)."""
    checks = [
        check(name, *values, bound) for values in zip(cases, measured, expected, strict=True)
    ]
    return max(checks, key=lambda one: abs(one.error) if np.isfinite(one.error) else np.inf)
