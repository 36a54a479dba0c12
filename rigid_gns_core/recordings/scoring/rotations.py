# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scores of rotations, where the tracker has measured none."""

from __future__ import annotations

from typing import Any

from ...scenes.state import Trajectory
from ...tracking.pose_noise import rotates

NOTE = (
    'Rotations are not tracked: they never change. There are no errors of spin and rotation, and '
    'no rotational energy of the tracked spheres.'
)


def leave_out_unknown(report: dict[str, Any], reference: Trajectory) -> list[str]:
    """Set to None what a report says of unknown rotations; a note, where it does.

    Args:
        report: Report of `evaluate`; changed.
        reference: Tracked poses.
    """
    if rotates(reference.quaternions):
        return []
    for name in ('spin_error', 'rotation_error'):
        for part in (report['errors'], *report['horizons'].values()):
            part[name] = None
    report['laws']['reference']['rotational_energy'] = None
    return [NOTE]
