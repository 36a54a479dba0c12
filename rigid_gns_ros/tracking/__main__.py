"""Compile the tracking filter, so that no node has to: `python -m rigid_gns_ros.tracking`."""

from __future__ import annotations

import sys

from .warm import warm_up

if __name__ == '__main__':
    warm_up()
    print('rigid_gns: the tracking filter is compiled', file=sys.stderr)
