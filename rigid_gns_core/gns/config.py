# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Configuration of the GNS, and the shapes of its weights. No torch in here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .graph import Connectivity, Reach
from ..files.config import check_least


@dataclass(frozen=True)
class GNSConfig:
    """The thesis' network; each switch turns one piece off for an ablation.

    Args:
        message_passing_steps: M, each with weights of its own.
        history: H previous velocities beside the current one.
        width: Latent and hidden size h.
        connectivity: Graph construction, see `rigid_gns_core.gns.graph.Reach`.
        epsilon: Reach of `epsilon` connectivity [radii].
        margin: Added to the reach of the others [radii].
        ground_edge: Permanent edge to the ground.
        third_law: Antisymmetric particle messages (Newton's third law).
        mask_pose: Hide absolute position and quaternion from the network.
        target: What the decoder emits: next `velocity` (thesis) or `acceleration` (original GNS).
        sphere_properties: Feed radius and mass of each sphere (the thesis' optional f_i).
    """

    message_passing_steps: int = 5
    history: int = 2
    width: int = 128
    connectivity: Connectivity = 'vi'
    epsilon: float = 0.1
    margin: float = 0.05
    ground_edge: bool = True
    third_law: bool = True
    mask_pose: bool = True
    target: Literal['velocity', 'acceleration'] = 'velocity'
    sphere_properties: bool = False

    def __post_init__(self) -> None:
        check_least(self, 1, 'message_passing_steps', 'width')
        check_least(self, 0, 'history')

    @property
    def node_size(self) -> int:
        """Features of a node: velocities, angular velocities, and what switches add."""
        pose = 0 if self.mask_pose else 7
        return 6 * (self.history + 1) + pose + (2 if self.sphere_properties else 0)

    def reach(self, radius: float = 1.0) -> Reach:
        """Graph construction for spheres of `radius` [m]."""
        return Reach(
            self.connectivity, self.epsilon * radius, self.margin * radius, self.ground_edge
        )
