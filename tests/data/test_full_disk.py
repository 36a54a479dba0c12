# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A full disk: nothing of a data file is left, and the error is one line."""

from __future__ import annotations

from pathlib import Path
import resource
import subprocess
import sys

import numpy as np
import pytest
from rigid_gns_core.data.records import read_record

ROLLOUT = ('rollout', '--scene', 'box_154', '--model', 'laws', '--steps')
LIMIT = 20_000  # [bytes], far less than a record takes


def rollout(out: Path, steps: int, *, limited: bool) -> subprocess.CompletedProcess[str]:
    """Run `rigid-gns rollout` where files may not grow, which fails as a full disk does."""
    return subprocess.run(
        [sys.executable, '-m', 'rigid_gns_core.commands.cli', *ROLLOUT, str(steps)]
        + ['--out', str(out)],
        preexec_fn=lambda: limited and resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, LIMIT)),
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def test_a_rollout_fails_in_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    out = tmp_path / 'deep' / 'rollout.h5'
    done = rollout(out, 3, limited=False)
    assert done.returncode == 0, done.stderr
    assert np.isfinite(read_record(out).trajectory.positions).all()
    out.unlink()
    failed = rollout(out, 3, limited=True)
    assert failed.returncode == 2, failed.stderr
    assert 'Traceback' not in failed.stderr
    assert failed.stderr.splitlines()[-1].startswith('rigid-gns rollout: error: ')
    assert f"cannot be written: File too large: '{out}'" in failed.stderr
    assert not list(out.parent.iterdir())


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='there is no /dev/full')
def test_a_disk_without_space_is_named(tmp_path: Path) -> None:
    from rigid_gns_core.files.atomic_file import whole_file

    def fill() -> None:
        with whole_file(tmp_path / 'a.json') as partial:
            partial.symlink_to('/dev/full')
            partial.write_text('x')

    with pytest.raises(OSError, match=r"cannot be written: No space left on device: '.*a\.json'"):
        fill()
    assert not list(tmp_path.iterdir())
