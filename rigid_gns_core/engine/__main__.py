# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compile the engine, so that no later process waits for it: `python -m rigid_gns_core.engine`."""

from __future__ import annotations

import sys

from .stepper import warm_up

if __name__ == '__main__':
    warm_up()
    print('rigid_gns: the engine is compiled', file=sys.stderr)
