# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""diagnostic_msgs/DiagnosticArray as CDR bytes.

The node's statuses and levels are in `rigid_gns_ros/node/diagnostics.py`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from .cdr import Writer

OK, WARN, ERROR = 0, 1, 2  # diagnostic_msgs/DiagnosticStatus
HARDWARE_ID = 'none'


@dataclass(frozen=True)
class Status:
    """One diagnostic_msgs/DiagnosticStatus.

    Args:
        level: OK, WARN or ERROR.
        name: Component that the status is of.
        message: One sentence.
        values: Values by key.
    """

    level: int
    name: str
    message: str
    values: Mapping[str, str] = field(default_factory=dict)


def encode_diagnostics(stamp_ns: int, statuses: Sequence[Status]) -> bytes:
    """CDR bytes of a message with this stamp [ns]."""
    writer = Writer()
    writer.header(stamp_ns, '')
    writer.numbers('I', len(statuses))
    for status in statuses:
        writer.numbers('B', status.level)
        writer.text('name', status.name)
        writer.text('message', status.message)
        writer.text('hardware_id', HARDWARE_ID)
        writer.numbers('I', len(status.values))
        for key, value in status.values.items():
            writer.text('key', key)
            writer.text('value', value)
    return writer.cdr
