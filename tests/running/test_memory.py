# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Memory that is freed and asked for again is not cleared again by the system."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

import pytest

MAIN = """
import resource
import numpy as np
from rigid_gns_core.running.memory import keep_freed_memory

print(keep_freed_memory())
np.ones(16 << 20)  # 128 MB, freed at once
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
np.ones(16 << 20)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def faults(**own: str) -> tuple[str, int]:
    """Whether memory is kept, and pages that the system had to clear for 128 MB asked for anew."""
    # in pages of 4 KB, not of 2 MB
    environment = {**os.environ, 'NUMPY_MADVISE_HUGEPAGE': '0', **own}
    done = subprocess.run(
        [sys.executable, '-c', MAIN], env=environment, check=True, capture_output=True, text=True
    )
    kept, count = done.stdout.split()
    return kept, int(count)


@pytest.mark.skipif(platform.libc_ver()[0] != 'glibc', reason='other libraries are left alone')
def test_freed_memory_is_kept_unless_the_user_says_otherwise() -> None:
    pages = (128 << 20) // 4096
    kept, count = faults()
    assert kept == 'True' and count < pages / 100
    left, count = faults(MALLOC_TRIM_THRESHOLD_='131072')
    assert left == 'False' and count > pages / 2
