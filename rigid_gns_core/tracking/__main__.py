# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compile the tracking filter, so that no node has to: `python -m rigid_gns_core.tracking`."""

from __future__ import annotations

import sys

from .warm import warm_up, warm_up_identification

if __name__ == '__main__':
    warm_up()
    warm_up_identification()
    print('rigid_gns: the tracking filter is compiled', file=sys.stderr)
