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

"""Windows of several steps, rolled out with gradients: each step starts from what was predicted.

One-step training sees only states near those of the teacher (thesis section 3.3); here the network
is asked to mend what it did itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from .windows import angles_of, Batch, Draw, owners, rotate_batch, Source, turned
from ...gns.config import GNSConfig
from ...gns.graph import build_graph
from ...gns.network import GNS
from ...gns.tensor_features import tensor_features, TensorGraph, TensorMotion

# radii from the truth beyond which a sphere is lost to chaos and teaches nothing any more
LOST = 0.5

# connections of a step from positions and velocities, which have no gradient, shape (n, 3) each
Connect = Callable[[Tensor, Tensor], TensorGraph]


class Windows(NamedTuple):
    """Windows of K steps, side by side; n spheres in all.

    start: with noise; positions: true ones after each step [m], shape (K, n, 3); targets: [v,
    omega] of each step [m/s, rad/s], shape (K, n, 6); properties: radius and mass, shape (n, 2);
    owner: index of the window, shape (n,); angles: by which windows are turned about gravity
    [rad], shape (windows,), or None; windows: number of windows; dt: time step [s].
    """

    start: TensorMotion
    positions: Tensor
    targets: Tensor
    properties: Tensor
    owner: Tensor
    angles: Tensor | None
    windows: int
    dt: float


class Frame(NamedTuple):
    """One step of all windows.

    batch: what went in; output: of the network, normalised, shape (n, 6); counted: the spheres
    that count, shape (n,).
    """

    batch: Batch
    output: Tensor
    counted: Tensor


def stack_windows(
    sources: Sequence[Source],
    draws: Sequence[Draw],
    config: GNSConfig,
    steps: int,
    corrects_target: bool,
) -> Windows:
    """Windows that were drawn, side by side."""
    starts, positions, targets, properties = [], [], [], []
    for draw in draws:
        source = sources[draw.source]
        motion, *first = source.start(draw, config, corrects_target)
        after = slice(draw.step + 1, draw.step + 1 + steps)
        target = np.concatenate([source.velocities[after], source.angular_velocities[after]], 2)
        target[0] = np.concatenate(first, axis=1)
        starts.append(motion)
        positions.append(source.positions[after])
        targets.append(target)
        properties.append(source.properties)
    return Windows(
        start=TensorMotion.of(starts),
        positions=torch.from_numpy(np.concatenate(positions, axis=1)),
        targets=torch.from_numpy(np.concatenate(targets, axis=1)),
        properties=torch.from_numpy(np.concatenate(properties)),
        owner=owners(sources, draws),
        angles=angles_of(draws),
        windows=len(draws),
        dt=sources[0].dt,
    )


def connector(sources: Sequence[Source], draws: Sequence[Draw], config: GNSConfig) -> Connect:
    """Return connections of windows by `build_graph`."""
    own = [sources[draw.source] for draw in draws]
    ends = np.cumsum([0, *(source.count for source in own)])
    spheres = [slice(*pair) for pair in pairwise(ends)]

    def connect(positions: Tensor, velocities: Tensor) -> TensorGraph:
        p, v = positions.numpy(), velocities.numpy()
        graphs = [
            build_graph(p[part], v[part], s.scene, s.dt, config.reach(s.radius))
            for s, part in zip(own, spheres, strict=True)
        ]
        return TensorGraph.of(graphs, [s.scene for s in own], [s.count for s in own])

    return connect


def roll_out(
    network: GNS, windows: Windows, connect: Connect, corrects_target: bool
) -> Iterator[Frame]:
    """Yield steps of all windows in closed loop, with gradients through features and integration.

    The graph is built anew in each step, from poses without gradient. A sphere counts until a step
    starts with it lost.

    Raises:
        FloatingPointError: A predicted position is not finite.
    """
    motion, config = windows.start, network.config
    counted = torch.ones_like(windows.owner, dtype=torch.bool)
    turns = None if windows.angles is None else windows.angles[windows.owner]
    for positions, target in zip(windows.positions, windows.targets, strict=True):
        here = motion.positions
        if not torch.isfinite(here).all():
            raise FloatingPointError(
                'a position is not finite in closed loop; train anew, in another folder, with a '
                'lower learning_rate, or with closed_loop_steps 1 first'
            )
        links = connect(here.detach(), motion.velocities[0].detach())
        graph = tensor_features(config, motion, links, windows.properties)
        if corrects_target:
            target = torch.cat([(positions - here) / windows.dt, target[:, 3:]], dim=1)
        batch = Batch(graph, target.float(), windows.owner, windows.windows)
        if windows.angles is not None:
            batch = rotate_batch(batch, windows.angles, config)
        output = network(batch.graph)
        yield Frame(batch, output, counted)
        predicted = network.decode(output, batch.graph.motion).double()
        if turns is not None:  # the network saw a turned world
            predicted = turned(predicted, -turns.double(), 2)
        motion = motion.advanced(predicted, windows.dt)
        counted = counted & near(motion.positions, positions, windows.properties[:, 0])


def near(positions: Tensor, truth: Tensor, radius: Tensor) -> Tensor:
    """Whether spheres are where they are to be, but for `LOST` radii; shape (n,)."""
    distance: Tensor = (positions - truth).detach().norm(dim=1)
    return distance < LOST * radius
