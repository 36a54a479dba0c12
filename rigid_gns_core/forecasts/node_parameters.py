# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the nodes `simulator` and `tracker`: defaults, units, ranges, descriptions.

A test compares docs/node.md with these tables.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any

from .crossing_planes import planes_of
from .moving_surfaces import bodies_of
from .tracker_kinds import names_of, TRACKERS
from ..errors import shown, UserError

Value = bool | int | float | str | list[float]


@dataclass(frozen=True)
class ParameterSpec:
    """One node parameter.

    Args:
        name: Name.
        default: Default value; it sets the type, and the length of a list.
        description: Description for `ros2 param describe`.
        unit: Unit; empty: none.
        low: Lower bound of a number.
        high: Upper bound of a number.
        least: Lower bound of values other than 0, where 0 has a meaning of its own.
        choices: Allowed values of a string; empty: any.
        dynamic: Whether it may change while the node runs; if not, it is read-only.
        check: Called with a value; raises UserError where it is not allowed.
    """

    name: str
    default: Value
    description: str
    unit: str = ''
    low: float = 0.0
    high: float = 0.0
    least: float = 0.0
    choices: tuple[str, ...] = ()
    dynamic: bool = False
    check: Callable[[Any], object] | None = None

    def problem(self, value: Any) -> str | None:
        """Why a value is not allowed, beyond type and range, which ROS checks; None: it is."""
        if self.choices and value not in self.choices:
            return f'{self.name} is {value!r}, allowed: {", ".join(self.choices)}'
        if self.least and value != 0 and not self.least <= value:
            span = f'{self.least:g} to {self.high:g} {self.unit}'
            return f'{self.name} is {value:g}, allowed: 0, or {span}'
        if isinstance(self.default, list):
            values = list(value) if isinstance(value, Iterable) else []
            numbers = all(isinstance(one, (int, float)) and isfinite(one) for one in values)
            if len(values) != len(self.default) or not numbers:
                return (
                    f'{self.name} is {shown(values)}, allowed: {len(self.default)} finite numbers'
                )
        try:
            if self.check is not None:
                self.check(value)
        except UserError as error:
            return str(error)
        return None


FRAME_ID = ParameterSpec('frame_id', 'world', 'coordinate frame of all poses')

SIMULATOR = (
    ParameterSpec('model', '', 'name or path of the model; empty: the shipped default'),
    ParameterSpec('scene', 'box_154', 'name of a shipped scene, or a YAML file'),
    FRAME_ID,
    ParameterSpec(
        'gravity_direction',
        [0.0, 0.0, 0.0],
        "direction of gravity in frame_id, of any length; all 0: the scene's",
    ),
    ParameterSpec(
        'rate',
        0.0,
        "predictions per second, at least 0.1; 0: the model's native rate for the scene's radius",
        'Hz',
        0.0,
        1000.0,
        0.1,
    ),
    ParameterSpec(
        'start',
        'first',
        'first: predict from the first frames on; every: each prediction from the newest frame; '
        'diverged: as first, but restart from the newest when the error exceeds resync_error',
        choices=('first', 'every', 'diverged'),
        dynamic=True,
    ),
    ParameterSpec(
        'resync_error',
        0.5,
        'error beyond which `start: diverged` restarts, in radii of the largest sphere; '
        'diagnostics warn of it in every mode',
        'radii',
        0.001,
        1000.0,
        dynamic=True,
    ),
    ParameterSpec(
        'resync_over',
        'max',
        'statistic of that error over the spheres: max: the worst sphere; mean: the mean of all',
        choices=('max', 'mean'),
        dynamic=True,
    ),
    ParameterSpec(
        'tracker_timeout',
        0.0,
        'stop predicting where no tracked frame came for so long, until frames come; 0: go on',
        's',
        0.0,
        3600.0,
        dynamic=True,
    ),
    ParameterSpec(
        'horizon',
        0.0,
        'how far ahead a trajectory is predicted from each tracked frame; 0: none',
        's',
        0.0,
        60.0,
        dynamic=True,
    ),
    ParameterSpec(
        'samples',
        0,
        'states drawn from the estimate of a frame for the spread of its future; 0: none',
        '',
        0,
        10_000,
        dynamic=True,
    ),
    ParameterSpec(
        'crossing_planes',
        '',
        'planes whose crossing within the horizon is forecast, as YAML of name and plane: '
        '{racket: {point: [0.5, 0, 0.3], normal: [-1, 0, 0]}}; empty: none',
        dynamic=True,
        check=planes_of,
    ),
    ParameterSpec(
        'moving_surfaces',
        '',
        'bodies that carry surfaces of the scene, as YAML of name, surfaces and topics: {racket: '
        '{surfaces: [1], pose: racket/pose, twist: racket/twist, plan: racket/plan}}; empty: none',
        check=bodies_of,
    ),
    ParameterSpec(
        'velocity_window',
        6,
        'number of tracked frames from which velocities are fitted; 1: start at rest',
        'frames',
        1,
        100,
    ),
    ParameterSpec(
        'match_spheres',
        False,
        'associate poses with tracks; they may come in any order, be missing, appear and vanish',
    ),
    ParameterSpec(
        'tracking_noise',
        0.0,
        'standard deviation of each tracked coordinate; 0: estimated from the frames',
        'm',
        0.0,
        1000.0,
    ),
    ParameterSpec(
        'latency',
        0.0,
        'how long before its stamp a frame was captured, of trackers that stamp on receipt; it is '
        'taken off each stamp',
        's',
        0.0,
        10.0,
    ),
    ParameterSpec(
        'tracker',
        '',
        'kind of tracker; empty: PoseArray, PointCloud2, or a single pose or point, each on its '
        'topic; else a topic or a frame of tf for each ball, or tracked_objects of this type',
        choices=TRACKERS,
    ),
    ParameterSpec(
        'balls',
        '',
        'names of the balls of such a tracker, in their order, divided by commas; empty: all '
        'objects of a message',
        check=names_of,
    ),
    ParameterSpec(
        'transform_timeout',
        0.1,
        'how long a frame of a tracker in another coordinate frame waits for its transform on /tf',
        's',
        0.0,
        10.0,
    ),
    ParameterSpec(
        'coast_time',
        0.0,
        'how long a track without a pose is coasted; 0: 2 sqrt(radius / gravity)',
        's',
        0.0,
        3600.0,
    ),
    ParameterSpec(
        'max_speed',
        0.0,
        'largest speed of a new track; 0: 50 sqrt(radius gravity)',
        'm/s',
        0.0,
        1e6,
    ),
    ParameterSpec(
        'learn',
        False,
        'fit air, contact laws and spins to its own tracks, and take what predicts better',
    ),
    ParameterSpec(
        'learned_scene',
        '',
        'scene file to which ~/save_scene writes what was learned',
        dynamic=True,
    ),
    ParameterSpec('record', '', 'folder of the bag to write; must not exist; empty: no recording'),
    ParameterSpec(
        'record_max_size',
        0.0,
        "size at which the bag's next file is begun, at least 0.001; 0: one file",
        'MB',
        0.0,
        1e6,
        least=1e-3,
    ),
    ParameterSpec(
        'record_max_duration',
        0.0,
        "duration at which the bag's next file is begun, at least 0.1; 0: one file",
        's',
        0.0,
        1e6,
        least=0.1,
    ),
    ParameterSpec('max_spheres', 1000, 'largest number of spheres accepted', '', 1, 100_000),
    ParameterSpec('threads', 1, 'CPU threads of BLAS, OpenMP and torch', '', 1, 256),
    ParameterSpec(
        'autostart', True, 'configure and activate at once; false: a supervisor does, by lifecycle'
    ),
)

TRACKER = (
    ParameterSpec('trajectory', '', 'HDF5 record to play; empty: the shipped one'),
    ParameterSpec(
        'live', False, 'run Bullet live on `scene` instead of a record (needs pybullet)'
    ),
    ParameterSpec('scene', 'box_154', 'shipped scene or YAML file, whose start a live run takes'),
    FRAME_ID,
    ParameterSpec('noise', 0.001, 'standard deviation added to each coordinate', 'm', 0.0, 1000.0),
    ParameterSpec('seed', 0, 'seed of the noise', '', 0, 2**31 - 1),
    ParameterSpec('loop', False, 'play again from the start at the end of the record'),
    ParameterSpec(
        'rate_factor',
        1.0,
        "frames come this many times faster than real time; stamps keep the record's own time, "
        'so values other than 1 are for `start: first` or simulated time',
        '',
        0.01,
        100.0,
    ),
    ParameterSpec('wait_for_subscriber', True, 'start when a node subscribes to tracked_poses'),
)


def with_defaults(recorded: Mapping[str, Any]) -> dict[str, Any]:
    """All parameters of the simulator, as recorded on ~/scene; missing ones have their defaults.

    Raises:
        UserError: One is of another type, or out of range: the recording is damaged.
    """
    values: dict[str, Any] = {}
    for spec in SIMULATOR:
        value: Any = recorded.get(spec.name, spec.default)
        if type(spec.default) is float and type(value) is int and abs(value) < 2**63:
            value = float(value)
        counted = type(spec.default) in (int, float)
        if type(value) is not type(spec.default):
            raise UserError(
                f'parameter {spec.name} is recorded as {shown(value)}, expected '
                f'{type(spec.default).__name__}'
            )
        number: Any = value if counted else spec.low
        if not spec.low <= number <= spec.high:
            raise UserError(
                f'parameter {spec.name} is recorded as {shown(value)}, expected {spec.low:g} to '
                f'{spec.high:g}'
            )
        if problem := spec.problem(value):
            raise UserError(f'parameter {problem}')
        values[spec.name] = value
    return values
