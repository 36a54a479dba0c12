# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a pose of a body must be."""

from __future__ import annotations

import numpy as np

from ..errors import UserError
from ..scenes.state import Array

# of the length of a quaternion from 1
_UNIT = 1e-3


def check_pose(pose: Array) -> None:
    """Raise UserError where a pose, shape (7,), is none."""
    if not np.isfinite(pose).all():
        raise UserError('a number of its pose is not finite: the body is not seen')
    length = float(np.linalg.norm(pose[3:]))
    if abs(length - 1.0) > _UNIT:
        raise UserError(f'its quaternion has length {length:.4g}, expected 1 within {_UNIT:g}')
