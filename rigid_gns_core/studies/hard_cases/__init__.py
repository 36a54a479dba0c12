# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hard cases: starts and scenes that are hard to simulate, and the checks of each."""

from .case import Case
from .cases import hard_cases
from .checks import measure_laws
from .engines import Engine, run_cases

__all__ = ['Case', 'Engine', 'hard_cases', 'measure_laws', 'run_cases']
