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

"""Training trajectories that stay on a device: batches are drawn and connected there by index."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
import torch
from torch import Tensor

from .closed_loop import Connect, Windows
from .windows import angles_of, Draw, Source
from ...gns.config import GNSConfig
from ...gns.device_graph import DeviceScenes
from ...gns.rotations import rotate_quaternions, rotation_between
from ...gns.tensor_features import TensorGraph, TensorMotion
from ...gns.tensor_graph import connect, Spheres

Index = NDArray[np.int64]


class Resident:
    """All trajectories on a device, a row for each sphere at each step; 104 bytes a row.

    Args:
        sources: Training trajectories, of spheres of one radius.
        config: The network's.
        device: Where they stay.
    """

    def __init__(self, sources: Sequence[Source], config: GNSConfig, device: torch.device) -> None:
        self.config, self.device, self.dt = config, device, sources[0].dt

        def rows(name: str) -> Tensor:
            parts = [getattr(s, name).reshape(-1, getattr(s, name).shape[-1]) for s in sources]
            return torch.from_numpy(np.concatenate(parts)).to(device)

        self.positions, self.quaternions = rows('positions'), rows('quaternions')
        self.velocities, self.angular_velocities = rows('velocities'), rows('angular_velocities')
        self.properties = rows('properties')
        self.counts = np.array([source.count for source in sources])
        scenes = [source.scene for source in sources]
        self.scenes = DeviceScenes.of(scenes, self.counts.tolist(), device)
        self.reach = config.reach(max(source.radius for source in sources))
        frames = np.array([source.steps + 1 for source in sources])
        self.first_row = np.cumsum([0, *(self.counts * frames)])[:-1]
        self.first_sphere = np.cumsum([0, *self.counts])[:-1]

    def windows(self, draws: Sequence[Draw], steps: int, corrects_target: bool) -> Windows:
        """Windows that were drawn, side by side; the same as `stack_windows`."""
        history = self.config.history
        source, step = np.array([(draw.source, draw.step) for draw in draws]).T
        known = np.array([history if d.known is None else min(d.known, history) for d in draws])
        oldest = np.maximum(step - known, 0)
        before = np.stack([np.maximum(step - h, oldest) for h in range(history + 1)])
        after = step + 1 + np.arange(steps)[:, None]
        past, future = self._rows(source, before), self._rows(source, after)
        start = TensorMotion(
            self.positions[past[0]],
            self.quaternions[past[0]],
            self.velocities[past],
            self.angular_velocities[past],
        )
        positions = self.positions[future]
        targets = torch.cat([self.velocities[future], self.angular_velocities[future]], dim=2)
        if draws[0].shifts is not None:
            start = self._noisy(start, draws)
            if corrects_target:
                after_first = self.quaternions[future[0]]
                targets[0, :, :3] = (positions[0] - start.positions) / self.dt
                targets[0, :, 3:] = rotation_between(start.quaternions, after_first) / self.dt
        owner, sphere = self._spheres(source)
        angles = angles_of(draws)
        return Windows(
            start=start,
            positions=positions,
            targets=targets,
            properties=self.properties[self._index(self.first_sphere[source][owner] + sphere)],
            owner=self._index(owner),
            angles=None if angles is None else angles.to(self.device),
            windows=len(draws),
            dt=self.dt,
        )

    def connector(self, draws: Sequence[Draw]) -> Connect:
        """Return connections of windows, found on the device."""
        source = np.array([draw.source for draw in draws])
        counts = self.counts[source]
        scenes = DeviceScenes(*(values[self._index(source)] for values in self.scenes))
        most = int(counts.max())  # of these, not of all trajectories: the curriculum is fast
        scenes = scenes._replace(
            present=scenes.present[:, :most],
            radius=scenes.radius[:, :most],
            mass=scenes.mass[:, :most],
        )
        owner, place = self._spheres(source)
        first = np.cumsum([0, *counts])[:-1]
        spheres = Spheres(self._index(owner), self._index(place), self._index(first))

        def graph(positions: Tensor, velocities: Tensor) -> TensorGraph:
            return connect(scenes, spheres, positions, velocities, self.dt, self.reach)

        return graph

    def _spheres(self, source: Index) -> tuple[Index, Index]:
        """Window of each sphere, and its number within it; shape (n,) each."""
        counts = self.counts[source]
        owner = np.repeat(np.arange(len(source)), counts)
        return owner, np.arange(len(owner)) - np.cumsum([0, *counts])[:-1][owner]

    def _rows(self, source: Index, frames: Index) -> Tensor:
        """Rows of all spheres at frames of each window, (k, windows); shape (k, n)."""
        owner, sphere = self._spheres(source)
        first = self.first_row[source] + frames * self.counts[source]
        return self._index(first[:, owner] + sphere)

    def _index(self, values: Index) -> Tensor:
        return torch.from_numpy(np.ascontiguousarray(values)).to(self.device)

    def _noisy(self, motion: TensorMotion, draws: Sequence[Draw]) -> TensorMotion:
        """With the noise that was drawn on the host: the same on every device."""
        shifts = [draw.shifts for draw in draws if draw.shifts is not None]

        def joined(name: str, axis: int) -> Tensor:
            whole = np.concatenate([getattr(shift, name) for shift in shifts], axis=axis)
            return torch.from_numpy(whole).to(self.device)

        return TensorMotion(
            motion.positions + joined('positions', 0),
            rotate_quaternions(motion.quaternions, joined('rotations', 0)),
            motion.velocities + joined('velocities', 1),
            motion.angular_velocities + joined('angular_velocities', 1),
        )
