# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Run by torchrun in test_distributed.py: what each process finds, saved into a folder."""

from dataclasses import replace
from pathlib import Path
import sys

import numpy as np
import pytest
from rigid_gns_core.gns.config import GNSConfig
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.similarity import ModelUnits
from rigid_gns_core.scenes.state import Trajectory
from rigid_gns_core.training.distributed import Processes, started_by_torchrun
from rigid_gns_core.training.gns.learner import GNSLearner, GNSTrainConfig
from rigid_gns_core.training.gns.windows import Noise, Source
from safetensors.torch import save_file
import torch

SCENE = Scene(surfaces=Plane.box(20.0, 20.0))
GNS = GNSTrainConfig(
    model=GNSConfig(message_passing_steps=2, width=8),
    batch=5,  # shares of 3 and 2 windows
    noise=Noise(0.01, True),
    energy_weight=0.1,
)


def straight(positions: np.ndarray, velocities: np.ndarray, steps: int = 8) -> Trajectory:
    """Spheres on straight ways, through each other and through the ground."""
    time = 0.1 * np.arange(steps + 1)[:, None, None]
    return Trajectory(
        positions=positions + time * velocities,
        quaternions=np.tile([0.0, 0, 0, 1], (steps + 1, len(positions), 1)),
        velocities=np.ones_like(time) * velocities,
        angular_velocities=np.zeros((steps + 1, len(positions), 3)),
        dt=0.1,
    )


def flying(count: int) -> Trajectory:
    """Trajectories of several counts, so that shares differ in weight."""
    rng = np.random.default_rng(count)
    return straight(rng.uniform(-6, 6, (count, 3)) + [0, 0, 8], rng.normal(size=(count, 3)))


def learners() -> dict[str, GNSLearner]:
    """One of each kind of training."""
    sources = [Source.of(flying(count), SCENE) for count in (2, 7, 25)]
    units = ModelUnits(radius=1.0, gravity=9.81, dt=0.1)
    return {
        'one_step': GNSLearner(GNS, sources, units),
        'closed_loop': GNSLearner(replace(GNS, closed_loop_steps=3), sources, units),
    }


def gradients(steps: int = 2) -> dict[str, torch.Tensor]:
    """Gradients of all parameters at some steps, and the loss of all processes."""
    found = {}
    for name, learner in learners().items():
        processes = learner.processes
        for step in range(steps):
            learner.network.zero_grad()
            loss = learner.shared_loss(step)
            loss.backward()
            whole = processes.sum(loss.item()) / processes.size
            found[f'{name}.{step}.loss'] = torch.tensor(whole, dtype=torch.float64)
            for index, parameter in enumerate(learner.parameters):
                if parameter.grad is not None:
                    found[f'{name}.{step}.{index}'] = parameter.grad.clone()
    return found


def main() -> None:
    """Save what this process finds."""
    torch.set_num_threads(1)
    with started_by_torchrun(torch.device('cpu')):
        processes = Processes()
        found = gradients()
        with pytest.raises(ValueError, match='2 processes cannot share a batch of 1'):
            processes.share([1])
        found['stops'] = torch.tensor([processes.any(processes.rank == 1), processes.any(False)])
        save_file(found, Path(sys.argv[1]) / f'{processes.rank}.safetensors')


if __name__ == '__main__':
    main()
