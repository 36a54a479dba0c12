# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The real node while everything around it goes wrong: what is published, lost and said.

    python benchmarks/node/fault_campaigns.py --json docs/model/fault_campaigns.json
    python benchmarks/node/fault_campaigns.py 'late frames' flood --runs 5 --json more.json
    python benchmarks/node/fault_campaigns.py --table docs/model/fault_campaigns.json

A campaign is some runs of one fault, a quarter of a minute each; those that compile take
minutes. Campaigns that are in the JSON already are left out, so that a run that was stopped goes
on; --again repeats them. Exit code 1: something wrong was published, or lost without a word.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
import os
from pathlib import Path
import resource
import subprocess
import sys
import tempfile
import time
from typing import Any

from judge import judge, summary
from kills import kills_while_compiling, kills_while_splitting
from motion import SCENE
from rigid_gns_core.files.strict_json import read_json, write_json
from rigid_gns_core.files.tables import format_rows
from rigid_gns_core.running.machine import describe_machine
from rigid_gns_ros.demo import node_environment, NodeProcess
import yaml

PLAYER = Path(__file__).with_name('faulty_tracker.py')
SECONDS = 8.0  # of each run
READY = 900.0  # a first start compiles [s]
LIMIT = 150_000  # of a file where the disk is full [bytes]
NOWHERE = '/proc/nowhere'  # not even root can make a folder here

# fault: parameters of the node
TRACKER = {
    'nothing': {},
    'lost frames': {},
    'late frames': {},
    'NaN mixed in': {},
    'flood': {},
    'tracker gone': {'tracker_timeout': '1.0'},
    'stamps ahead': {},
    'stamps back': {},
    'clock ahead': {'use_sim_time': 'true'},
    'clock back': {'use_sim_time': 'true'},
}
OTHERS = {'full disk': {}, 'read-only home': {}}
KILLS = {
    'kills while compiling': kills_while_compiling,
    'kills while splitting': kills_while_splitting,
}
CAMPAIGNS = (*TRACKER, *OTHERS, *KILLS)


class Simulator(NodeProcess):
    """The node as a process."""

    @property
    def pid(self) -> int:
        """Number of its process."""
        return self._process.pid


def run(fault: str, seed: int, folder: Path) -> dict[str, Any]:
    """One run of the node; its verdict."""
    environment = node_environment(folder)
    parameters = {'scene': str(folder / 'scene.yaml'), 'record': str(folder / 'bag')}
    parameters |= {'start': 'every', **TRACKER.get(fault, {})}
    (folder / 'scene.yaml').write_text(yaml.safe_dump(SCENE), encoding='utf-8')
    if fault == 'read-only home':
        environment |= {'HOME': NOWHERE, 'XDG_CACHE_HOME': NOWHERE, 'NUMBA_CACHE_DIR': NOWHERE}
        environment |= {'PYTHONDONTWRITEBYTECODE': '1'}  # ROS itself needs a folder for its log
    node = Simulator('simulator_node', folder, parameters, environment)
    try:
        # a node on simulated time has none yet, and is ready all the same
        node.wait_for('ready: ', READY)
        if fault == 'full disk':
            resource.prlimit(node.pid, resource.RLIMIT_FSIZE, (LIMIT, LIMIT))
        play = fault if fault in TRACKER else 'nothing'
        command = [sys.executable, str(PLAYER), play, '--seconds', str(SECONDS)]
        command += ['--seed', str(seed), '--out', str(folder / 'sent.json')]
        environment |= {'ROS_LOG_DIR': str(folder / 'player')}
        subprocess.run(command, env=environment, check=True, timeout=SECONDS + 60)
        node.check()
        node.stop()
    finally:
        node.kill()
    return asdict(judge(folder, node.log.read_text(errors='replace')))


def campaign(name: str, runs: int) -> dict[str, Any]:
    """Runs of one fault."""
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix='faults_') as scratch:
        if name in KILLS:
            found = KILLS[name](Path(scratch), runs)
        else:
            verdicts = []
            for seed in range(runs):
                folder = Path(scratch) / str(seed)
                folder.mkdir()
                verdicts.append(run(name, seed, folder))
            found = summary(verdicts) | {'each': verdicts}
    load = os.getloadavg()[0]
    return found | {'seconds': round(time.monotonic() - began, 1), 'load': round(load, 1)}


def table(report: dict[str, Any]) -> str:
    """Markdown tables of a report."""
    found = report['campaigns']
    head = ['fault', 'runs', 'sent', 'accepted', 'refused', 'lost', 'ends', 'silent', 'published']
    head += ['wrong', 'worst [radii]', 'went on']
    rows = []
    for name in (*TRACKER, *OTHERS):
        if name in found:
            one = found[name]
            counts = [str(one[key]) for key in ('runs', 'sent', 'accepted', 'refused', 'lost')]
            counts += [str(one[key]) for key in ('ends', 'silent', 'published', 'wrong')]
            ends = [f'{one["worst_radii"]:.2f}', f'{one["recovered"]} of {one["runs"]}']
            rows.append([name, *counts, *ends])
    text = format_rows(head, rows, markdown=True)
    kinds = [
        [name, *(str(found[name][key]) for key in ('runs', 'wrong', 'worst_s', 'said'))]
        for name in KILLS
        if name in found
    ]
    killed = format_rows(
        ['kills', 'number', 'wrong', 'worst loss [s]', 'said'], kinds, left=(0, -1), markdown=True
    )
    lines = [f'- {name}: ' + '; '.join(found[name]['said'] or ['nothing']) for name in found
             if name not in KILLS]  # fmt: skip
    return '\n\n'.join([text, killed, '\n'.join(lines)]) + '\n'


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('campaigns', nargs='*', help=f'of {", ".join(CAMPAIGNS)} (default: all)')
    parser.add_argument('--runs', type=int, default=3, help='of each campaign')
    parser.add_argument('--json', type=Path, help='where results go and are kept')
    parser.add_argument('--again', action='store_true', help='repeat what is in the JSON')
    parser.add_argument('--table', type=Path, help='only print the tables of this JSON')
    arguments = parser.parse_args()
    if arguments.table:
        print(table(read_json(arguments.table)), end='')
        return 0
    for name in arguments.campaigns:
        if name not in CAMPAIGNS:
            parser.error(f'no campaign {name!r}, expected {", ".join(CAMPAIGNS)}')
    report: dict[str, Any] = {'machine': describe_machine(), 'campaigns': {}}
    if arguments.json and arguments.json.is_file():
        report['campaigns'] = read_json(arguments.json)['campaigns']
    bad = []
    for name in arguments.campaigns or CAMPAIGNS:
        if arguments.again or name not in report['campaigns']:
            print(f'{name}: ', end='', flush=True)
            report['campaigns'][name] = campaign(name, arguments.runs)
            if arguments.json:
                write_json(arguments.json, report)
        one = report['campaigns'][name]
        shown = {key: value for key, value in one.items() if key not in ('each', 'said')}
        print(', '.join(f'{key} {value}' for key, value in shown.items()), flush=True)
        for text in one['said'] if isinstance(one['said'], list) else [one['said']]:
            print(f'    {text}')
        if one['wrong'] or one.get('silent'):
            bad.append(name)
    return int(bool(bad))


if __name__ == '__main__':
    sys.exit(main())
