# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How spheres start: at given places, in blocks, or drawn at random."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Literal

import numpy as np

from .plane import Vector
from .state import Array, LARGEST
from ..errors import shown
from ..files.config import ConfigError

# spheres of a start: tens of gigabytes in the engine
MOST = 10_000_000

Layout = Literal['scattered', 'floor', 'blocks']


@dataclass(frozen=True)
class Block:
    """A cuboid of spheres on a grid along the axes.

    Args:
        count: Spheres along x, y and z.
        corner: Centre of the sphere with the lowest x, y and z [m].
        pitch: Distance of neighbouring centres [m].
        lean: Shift along x and y from each layer to the next [m]; neighbours keep their distance.
            Layers right above each other would bounce as columns that nothing tips.
    """

    count: tuple[int, int, int]
    corner: tuple[float, float, float]
    pitch: float = 2.0
    lean: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if min(self.count) < 1:
            raise ConfigError(f'count of a block is {list(self.count)}, expected at least 1 each')
        if not (self.pitch > 0 and np.isfinite(self.pitch)):
            raise ConfigError(f'pitch of a block is {self.pitch:g} m, expected a positive number')
        if not np.isfinite(self.corner).all():
            raise ConfigError(f'corner of a block is {list(self.corner)}, expected finite numbers')
        if not np.hypot(*self.lean) < self.pitch:
            raise ConfigError(
                f'lean of a block is {list(self.lean)} m, expected less than its pitch, '
                f'{self.pitch:g} m'
            )

    @property
    def positions(self) -> Array:
        """Centres [m], shape (n, 3)."""
        steps = np.array(list(np.ndindex(self.count)), dtype=np.float64)
        layer = np.sqrt(self.pitch**2 - np.square(self.lean).sum())
        axes = np.array([(self.pitch, 0, 0), (0, self.pitch, 0), (*self.lean, layer)])
        places: Array = np.asarray(self.corner) + steps @ axes
        return places


@dataclass(frozen=True)
class StartRecipe:
    """Spheres at the start: where they are and how they move.

    Places are random unless `blocks` or `at` say them.

    Args:
        spheres: Number of spheres. None: as many as `blocks` and `at` hold, else 1.
        height: Lowest and highest centre above z = 0 [m]; with layout `blocks`, of the lowest
            layer of those that hang; a floor needs none.
        length_x: Full length along x of the region around the scene's middle [m]; None: between
            the walls.
        length_y: The same along y [m].
        gap: Least distance between surfaces at the start [m]; not between the spheres of a block,
            nor to the ground below it. On a floor, a gap of 0 lets some spheres touch.
        seed: Seed of the places.
        layout: `scattered` touches nothing; on a `floor` every sphere rests on the ground;
            `blocks` are one to four grids of touching spheres, turned about z, that rest on the
            ground or hang in the air.
        speed: Lowest and highest speed [m/s], one for each sphere that moves, in a random
            direction: a horizontal one on a floor and in blocks.
        spin: Lowest and highest angular speed [rad/s] of the same spheres, about a random axis.
        moving: Probability of each sphere to have speed and spin.
        blocks: Cuboids of spheres at given places; these spheres come first.
        at: Given centres [m].
        velocities: Given velocities [m/s], one per centre in `at`.
        angular_velocities: Given angular velocities [rad/s], one per centre in `at`.
        quaternions: Given rotations (x, y, z, w), one per centre in `at`.
    """

    spheres: int = None  # type: ignore[assignment]
    height: tuple[float, float] = (0.0, 150.0)
    length_x: float | None = None
    length_y: float | None = None
    gap: float = 0.1
    seed: int = 0
    layout: Layout = 'scattered'
    speed: tuple[float, float] = (0.0, 0.0)
    spin: tuple[float, float] = (0.0, 0.0)
    moving: float = 1.0
    blocks: tuple[Block, ...] = ()
    at: tuple[Vector, ...] = ()
    velocities: tuple[Vector, ...] = ()
    angular_velocities: tuple[Vector, ...] = ()
    quaternions: tuple[tuple[float, float, float, float], ...] = ()

    def __post_init__(self) -> None:
        placed = len(self.at) + sum(math.prod(block.count) for block in self.blocks)
        if self.spheres is None:
            object.__setattr__(self, 'spheres', placed or 1)
        if not 1 <= self.spheres <= MOST:
            raise ConfigError(f'spheres is {self.spheres}, expected from 1 to {MOST}')
        if not 0 <= self.seed < 2**63:  # what a record holds
            raise ConfigError(f'seed is {self.seed}, expected from 0 to {2**63 - 1}')
        if placed and self.spheres != placed:
            raise ConfigError(
                f'spheres is {self.spheres}, but blocks and at hold {placed}; leave spheres out'
            )
        if placed and self.layout != 'scattered':
            raise ConfigError(
                f'layout is {self.layout!r}, but blocks or at give the places; leave one out'
            )
        for name in ('at', 'velocities', 'angular_velocities', 'quaternions'):
            given = getattr(self, name)
            if given and name != 'at' and (len(given) != len(self.at) or self.blocks):
                raise ConfigError(
                    f'{name} has {len(given)} values for {len(self.at)} centres in at and '
                    f'{len(self.blocks)} blocks, expected one per centre and no blocks'
                )
            if not (np.abs(given) <= LARGEST).all():
                raise ConfigError(
                    f'{name} is {shown(given)}, expected finite numbers of at most {LARGEST:g}'
                )
            moving = name.endswith('velocities') and not self.speed == self.spin == (0.0, 0.0)
            if given and moving:
                raise ConfigError(f'{name} and speed or spin say how spheres move; leave one out')
        check_range('height', self.height, -np.inf)
        for name in ('length_x', 'length_y'):
            length = getattr(self, name)
            if length is not None and not 0 <= length <= LARGEST:
                raise ConfigError(
                    f'{name} is {length:g} m, expected a length from 0 to {LARGEST:g}; '
                    'leave it out where walls bound the start'
                )
        if not (self.gap >= 0 and np.isfinite(self.gap)):
            raise ConfigError(f'gap is {self.gap:g} m, expected a finite length, at least 0')
        check_range('speed', self.speed, 0.0)
        check_range('spin', self.spin, 0.0)
        if not 0 <= self.moving <= 1:
            raise ConfigError(f'moving is {self.moving:g}, expected a share from 0 to 1')


def check_range(name: str, value: tuple[float, float], least: float) -> None:
    """Raise ConfigError where `value` is not a finite [lowest, highest] with lowest >= `least`."""
    low, high = value
    if not (least <= low <= high <= LARGEST):
        bound = '' if least == -np.inf else f' with lowest at least {least:g}'
        bound += '' if not high > LARGEST else f' and highest at most {LARGEST:g}'
        raise ConfigError(f'{name} is [{low:g}, {high:g}], expected [lowest, highest]{bound}')
