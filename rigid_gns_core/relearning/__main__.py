# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fit in a process of its own: tracks and scenes on the input, what was learned on the output."""

from __future__ import annotations

import json
import os
import sys

from .pipe import decode_task
from .relearn import relearn
from ..errors import UserError
from ..running.workers import leave_with_parent

if __name__ == '__main__':
    leave_with_parent()
    os.nice(int(sys.argv[1]))
    try:
        text = relearn(*decode_task(sys.stdin.buffer.read())).json
    except UserError as error:
        text = json.dumps({'error': str(error)})
    print(text)
