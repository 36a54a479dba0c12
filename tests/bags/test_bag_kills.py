# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.messages.poses import encode_float64

ROOT = Path(__file__).parents[2]


WRITER = """
import sys, time
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.messages.poses import encode_float64
bag = BagWriter(sys.argv[1], on_error=lambda text: print(text, flush=True))
bag.add_topic('/a', 'std_msgs/msg/Float64', 'reliable')
"""


def run_writer(folder: Path, body: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, '-c', WRITER + body, str(folder)],
        text=True,
        stdout=subprocess.PIPE,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
    )


def test_a_killed_recorder_loses_half_a_second_at_most(tmp_path):
    process = run_writer(
        tmp_path / 'bag',
        """
for k in range(100_000):
    bag.write('/a', encode_float64(k), time.time_ns())
    print(k, flush=True)
    time.sleep(0.01)
""",
    )
    assert process.stdout is not None
    begin = time.monotonic()
    sent = 0
    while time.monotonic() < begin + 2.0:
        sent = int(process.stdout.readline())
    os.kill(process.pid, signal.SIGKILL)
    process.wait(timeout=10)
    process.stdout.close()
    bag = read_bag(tmp_path / 'bag')
    messages = bag.topics['/a'].messages
    assert messages == [encode_float64(k) for k in range(len(messages))]
    # flushed every 0.5 s of 2 s; a second of slack, since the machine may be busy
    assert len(messages) > sent * 0.25
    assert 'no metadata.yaml, so the recorder did not finish' in bag.warnings[0]
    assert 'has no end' in bag.warnings[1]


def test_an_open_recorder_is_closed_at_exit(tmp_path):
    process = run_writer(
        tmp_path / 'bag',
        """
for k in range(10):
    bag.write('/a', encode_float64(k), k)
raise SystemExit(3)
""",
    )
    process.communicate(timeout=20)
    assert process.returncode == 3
    bag = read_bag(tmp_path / 'bag')
    assert (len(bag.topics['/a']), bag.warnings) == (10, ())


def test_a_full_disk_stops_the_recording_but_not_the_program(tmp_path):
    # a limit on the size of files fails in the same way, in the middle of a write
    process = run_writer(
        tmp_path / 'bag',
        """
import resource
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
for k in range(5000):
    bag.write('/a', encode_float64(k), k)
while bag.error is None:
    time.sleep(0.01)
bag.write('/a', encode_float64(0), 0)
bag.close()
print(bag.topics['/a'], bag.lost, flush=True)
""",
    )
    out, _ = process.communicate(timeout=20)
    assert process.returncode == 0
    error, counts = out.splitlines()
    assert 'recording into' in error
    assert 'has stopped' in error
    lost = int(counts.split()[1])
    bag = read_bag(tmp_path / 'bag')
    assert not (tmp_path / 'bag' / 'metadata.yaml').exists()
    assert len(bag.topics.get('/a', ())) + lost >= 5001
