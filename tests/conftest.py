# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Set-up of all tests: bounded threads, ROS kept to itself, tolerances per dtype."""

from __future__ import annotations

import os
from pathlib import Path
import signal
import tempfile

import numpy as np
import pytest

pytest_plugins = ['recorded_bags']  # write_bag, poses_cdr: of several folders

# Two workers on two cores: a second thread per worker only waits. Set before NumPy's users start.
for _name in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS'):
    os.environ.setdefault(_name, '1')


def pytest_configure(config: pytest.Config) -> None:
    """Keep the nodes of this worker apart from other workers and from the robot next door.

    Set before rclpy is imported anywhere, and inherited by the processes that tests start.
    """
    # a script's `make test &` ignores Ctrl-C, nohup a hangup, as would then all that tests start
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        signal.signal(signal.SIGHUP, lambda *_: None)  # a handler is not inherited
    worker = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0')[2:])
    os.environ['ROS_DOMAIN_ID'] = str(50 + worker % 40)  # 0 to 101 have ports of their own
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ.pop('ROS_LOCALHOST_ONLY', None)
    os.environ.pop('RMW_IMPLEMENTATION', None)  # the wheels have Fast DDS only
    profile = Path(__file__).parent / 'ros' / 'fastdds.xml'
    if profile.is_file():
        os.environ['FASTRTPS_DEFAULT_PROFILES_FILE'] = str(profile)
    if 'ROS_LOG_DIR' not in os.environ:  # a worker inherits the folder of its parent
        os.environ['ROS_LOG_DIR'] = tempfile.mkdtemp(prefix='rigid_gns_ros_log_')
    os.environ.setdefault('MPLBACKEND', 'Agg')


@pytest.fixture(autouse=True, scope='session')
def one_thread() -> None:
    """Torch reads OMP_NUM_THREADS at import; say it again for a torch that was there before."""
    try:
        import torch
    except ModuleNotFoundError:
        return
    torch.set_num_threads(1)


@pytest.fixture(scope='session')
def tolerance() -> dict[str, dict[str, float]]:
    """Tolerances by name of a dtype, as in `assert_allclose(a, b, **tolerance['float32'])`.

    A few hundred roundings of numbers of order one; float32 has 2^-24, float64 2^-53 each.
    """
    return {
        name: {'rtol': 1e3 * float(np.finfo(name).eps), 'atol': 1e3 * float(np.finfo(name).eps)}
        for name in ('float32', 'float64')
    }
