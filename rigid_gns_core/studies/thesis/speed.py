# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Speed of a variant in frames per second (thesis section 4.3.5), with random weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import time
from typing import Any

import numpy as np

from .cell import Cell
from .metrics import describe
from ...data.common_scene import common_scene
from ...data.records import Record
from ...files.config import to_mapping
from ...prediction.gns import GNSSimulator
from ...running.machine import cpu_name, load_average

REPEATS = 3


def measure_speed(cell: Cell, records: Sequence[Record]) -> dict[str, Any]:
    """Time single steps from states of the reference, so that graphs do not depend on weights.

    Frames are evenly spaced over each trajectory. A step is graph, features, network and
    integration, in one thread. The fastest of several repeats counts, as the machine may be
    shared.

    Returns:
        Means over the frames of each record in `values`, of `frames_per_second`,
        `seconds_per_frame`, `edges` (between spheres, counted once) and `surface_edges`; `cpu` and
        `load`.
    """
    import torch

    from ...gns.motion import Motion
    from ...gns.network import GNS
    from ...training.gns.windows import Source

    model = cell.budget.training(cell.changes, cell.seed).model
    model = replace(model, width=cell.budget.speed_width)
    torch.manual_seed(cell.seed)
    tensors = {name: value.numpy() for name, value in GNS(model).state_dict().items()}
    units, materials = common_scene(records)
    card = {'config': to_mapping(model), 'units': to_mapping(units), 'materials': materials}
    simulator = GNSSimulator(tensors, card, cell.name)
    rows = []
    for record in records:
        source = Source.of(record.trajectory, record.scene)
        last = source.steps - 1
        frames = np.unique(np.linspace(0, last, cell.budget.speed_frames).round().astype(int))
        motions: list[Motion] = [source.motion(int(frame), model.history) for frame in frames]
        stepper: Any = simulator.stepper(record.scene, record.trajectory[0])
        best = float('inf')
        stepper.step()  # one-time set-up is not timed
        for _ in range(REPEATS):
            seconds = 0.0
            for motion in motions:
                stepper.motion = motion
                begin = time.perf_counter()
                stepper.step()
                seconds += time.perf_counter() - begin
            best = min(best, seconds / len(motions))
        edges = [stepper.graph.connect(motion) for motion in motions]
        rows.append(
            {
                'seconds_per_frame': best,
                'frames_per_second': 1.0 / best,
                'edges': float(np.mean([len(each.senders) / 2 for each in edges])),
                'surface_edges': float(np.mean([len(each.surface_receivers) for each in edges])),
            }
        )
    return {
        **describe(records),
        'values': {name: [row[name] for row in rows] for name in rows[0]},
        'cpu': cpu_name(),
        'load': load_average(),
    }
