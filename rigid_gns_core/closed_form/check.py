# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

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
    """Compare a quantity with its expected value."""
    error = (measured - expected) / abs(expected) if expected else measured
    return Check(name, case, float(measured), float(expected), float(error), bound)


def worst(name: str, cases: list[str], measured: Array, expected: Array, bound: float) -> Check:
    """Check of the case with the largest error; measured and expected: shape (cases,)."""
    checks = [
        check(name, *values, bound) for values in zip(cases, measured, expected, strict=True)
    ]
    return max(checks, key=lambda case: abs(case.error) if np.isfinite(case.error) else np.inf)
