# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Windows rolled out with gradients: each step starts from what was predicted.

One-step training sees only states near those of the teacher (thesis section 3.3); over several
steps the network learns to correct its own errors.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import torch
from torch import Tensor

from .windows import Windows
from ...gns.config import GNSConfig
from ...gns.features import Features
from ...gns.motion import Motion
from ...gns.network import GNS

# distance from the truth [radii] from which a sphere is lost to chaos and left out of the loss
LOST = 0.5


class Batch(NamedTuple):
    """One step of all windows.

    graph: input of the network; next_motion: [v, omega] at k + 1 [m/s, rad/s], shape (n, 6);
    owner: index of the window, shape (n,); windows: number of windows.
    """

    graph: Features
    next_motion: Tensor
    owner: Tensor
    windows: int


class Frame(NamedTuple):
    """Result of a step of all windows.

    batch: input; output: of the network, normalised, shape (n, 6); counted: spheres that are not
    lost, shape (n,).
    """

    batch: Batch
    output: Tensor
    counted: Tensor


def batch_of(windows: Windows, step: int, motion: Motion, corrects_target: bool) -> Batch:
    """Batch of a step of the windows, counted from 0, that starts with this motion."""
    graph, target = windows.graph, windows.targets[step]
    if corrects_target:
        velocity = (windows.positions[step] - motion.positions) / graph.dt
        target = torch.cat([velocity, target[:, 3:]], dim=1)
    batch = Batch(graph.features(motion), target.float(), graph.owner, len(graph.scenes))
    return batch if windows.angles is None else rotate_batch(batch, windows.angles, graph.config)


def roll_out(network: GNS, windows: Windows, corrects_target: bool) -> Iterator[Frame]:
    """Yield steps of all windows in closed loop, with gradients through features and integration.

    The graph is built anew in each step, from poses without gradient. A sphere that is lost at the
    start of a step no longer counts.

    Raises:
        FloatingPointError: A predicted position is not finite.
    """
    motion, graph = windows.start, windows.graph
    counted = torch.ones_like(graph.owner, dtype=torch.bool)
    steps = len(windows.targets)
    for step in range(steps):
        if not torch.isfinite(motion.positions).all():
            raise FloatingPointError(
                'a position is not finite in closed loop; train anew, in another folder, with a '
                'lower learning_rate, or with closed_loop_steps 1 first'
            )
        batch = batch_of(windows, step, motion, corrects_target)
        output = network(batch.graph)
        yield Frame(batch, output, counted)
        if step + 1 == steps:
            return
        predicted = network.decode(output, batch.graph.motion).double()
        if windows.angles is not None:  # the network saw a turned world
            predicted = turned(predicted, -windows.angles[graph.owner].double(), 2)
        motion = motion.advanced(predicted, graph.dt)
        truth, radius = windows.positions[step], graph.properties[:, 0]
        counted = counted & near(motion.positions, truth, radius)


def near(positions: Tensor, truth: Tensor, radius: Tensor) -> Tensor:
    """Whether spheres are within `LOST` radii of the truth; shape (n,)."""
    distance: Tensor = (positions - truth).detach().norm(dim=1)
    return distance < LOST * radius


def rotate_batch(batch: Batch, angles: Tensor, config: GNSConfig) -> Batch:
    """Turn every window about the z axis by its angle [rad], shape (windows,)."""
    graph = batch.graph
    node = angles[batch.owner]
    graph = graph._replace(
        nodes=turned(graph.nodes, node, 2 * (config.history + 1)),
        edges=turned(graph.edges, node[graph.receivers], 1),
        surface_edges=turned(graph.surface_edges, node[graph.surface_receivers], 3),
        motion=turned(graph.motion, node, 2),
    )
    return batch._replace(graph=graph, next_motion=turned(batch.next_motion, node, 2))


def turned(values: Tensor, angle: Tensor, vectors: int) -> Tensor:
    """Rows with the first `vectors` triples turned about z by each row's angle [rad], (rows,)."""
    block = values[:, : 3 * vectors].reshape(-1, vectors, 3)
    cosine, sine = torch.cos(angle)[:, None], torch.sin(angle)[:, None]
    x, y = block[..., 0], block[..., 1]
    block = torch.stack([cosine * x - sine * y, sine * x + cosine * y, block[..., 2]], dim=-1)
    return torch.cat([block.flatten(1), values[:, 3 * vectors :]], dim=1)
