# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reports and figures of a prediction and its reference; see docs/report.md."""

from __future__ import annotations

from .comparison import Comparison
from .report.page import write_report

__all__ = ['Comparison', 'write_report']
