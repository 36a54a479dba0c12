"""A prediction beside its reference in one HTML file that opens offline; see docs/report.md."""

from __future__ import annotations

from .comparison import Comparison
from .page import write_report

__all__ = ['Comparison', 'write_report']
