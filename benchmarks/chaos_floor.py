# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""How far two equally good teachers are apart: the floor beside which long errors are read.

    python benchmarks/chaos_floor.py --data data/gns_test --steps 300 --json floor.json

Each record is simulated again by Bullet at half and at twice the substeps it was made with, and
scored like a model's prediction. The floor of an error is the larger of the two; in a chaotic
scene one below it means nothing. Needs pybullet.
"""

from __future__ import annotations

import argparse
from dataclasses import fields, replace
from pathlib import Path
import sys
from typing import Any

from rigid_gns_core.data.records import read_records, Record
from rigid_gns_core.files.strict_json import write_json
from rigid_gns_core.running.progress import Progress
from rigid_gns_core.scenes.state import Trajectory
from rigid_gns_core.scoring.evaluate import evaluate, format_table, summarise
from rigid_gns_core.teacher.bullet import simulate
from rigid_gns_core.teacher.settings import TeacherSettings

VARIANTS = {'half': 0.5, 'twice': 2.0}


def again(record: Record, factor: float, steps: int) -> Trajectory:
    """Return the record's start, simulated at `factor` times its substeps."""
    known = {field.name for field in fields(TeacherSettings)}
    settings = TeacherSettings(**{k: v for k, v in record.teacher.items() if k in known})
    settings = replace(settings, substeps=round(settings.substeps * factor))
    return simulate(record.scene, record.trajectory[0], steps, record.trajectory.dt, settings)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--data', required=True, type=Path, help='folder made by generate')
    parser.add_argument('--steps', type=int, default=300)
    parser.add_argument('--json', type=Path, help='write all numbers to this file')
    arguments = parser.parse_args()
    records = read_records(arguments.data)
    result: dict[str, Any] = {'data': arguments.data.name, 'steps': arguments.steps}
    with Progress(len(records) * len(VARIANTS), 'floor', unit='trajectory') as progress:
        for name, factor in VARIANTS.items():
            reports = []
            for record in records:
                predicted = again(record, factor, min(arguments.steps, record.trajectory.steps))
                reports.append(
                    evaluate(predicted, record.trajectory, record.scene, velocities='poses')
                )
                progress.update()
            result[name] = {'summary': summarise(reports), 'records': reports}
    for name in VARIANTS:
        print(f'\nBullet at {name} the substeps\n')
        print(format_table(result[name]['summary']), end='')
    if arguments.json is not None:
        write_json(arguments.json, result)
    return 0


if __name__ == '__main__':
    sys.exit(main())
