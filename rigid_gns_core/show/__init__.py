# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A prediction beside its reference in one HTML file that opens offline; see docs/report.md."""

from __future__ import annotations

from .comparison import Comparison
from .report.page import write_report

__all__ = ['Comparison', 'write_report']
