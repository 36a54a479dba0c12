# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Identification of materials: least squares of short rollouts against tracked poses.

From a tracked start, the laws predict some steps. Their errors, in standard deviations of the
tracker's noise, are minimised by Gauss-Newton steps (`scipy.optimize.least_squares`) under the
Cauchy loss, since a missed collision carries no information on materials.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from .fit import MaterialFit, MATERIALS, most_evaluations
from .windows import deviations, noise_of, Window, windows_of
from ..data.records import Record
from ..errors import UserError
from ..rollout.simulator import Simulator
from ..running.progress import Progress
from ..scenes.scene import Scene

DEFAULT = ('restitution', 'friction', 'rolling_friction')
# one window in this many is held out for validation
_HELD_OUT = 5


@dataclass(frozen=True)
class Fitted:
    """One material.

    Args:
        value: Fitted value; the scene's where the data do not identify it.
        error: Standard error from the data, without that of the model; None: not identified.
        before: Value of the scene.
        told: Whether the data identify it.
    """

    value: float
    error: float | None
    before: float
    told: bool


@dataclass(frozen=True)
class Calibration:
    """Fitted materials.

    Args:
        materials: Materials by name.
        windows: Numbers of windows fitted and held out.
        steps: Steps of a window.
        noise: Measurement noise: `position` [m], `rotation` [rad] or None.
        position_error: Mean error after `steps` in held-out windows, over spheres with a trusted
            start, with the scene's materials and with the fitted ones [m].
    """

    materials: dict[str, Fitted]
    windows: tuple[int, int]
    steps: int
    noise: dict[str, float | None]
    position_error: tuple[float, float]

    @property
    def values(self) -> dict[str, float]:
        """Value of each material."""
        return {name: material.value for name, material in self.materials.items()}


def calibrate(
    simulator: Simulator,
    records: Sequence[Record],
    *,
    names: Sequence[str] = DEFAULT,
    steps: int = 6,
    most: int = 300,
    seed: int = 0,
) -> Calibration:
    """Fit materials to tracked poses.

    Args:
        simulator: Model that takes materials.
        records: Tracked poses at the model's time step.
        names: Materials to fit, of `MATERIALS`.
        steps: Steps of a window: few, as errors grow with each collision.
        most: Largest number of windows; if there are more, a random choice of them.
        seed: Seed of that choice.

    Raises:
        UserError: The model has no materials, a name is unknown, or the records do not serve.
    """
    _check(simulator, records, names, steps)
    windows = windows_of(records, steps)
    if len(windows) > most:
        chosen = np.random.default_rng(seed).choice(len(windows), most, replace=False)
        windows = [windows[index] for index in np.sort(chosen)]
    held = windows[_HELD_OUT - 1 :: _HELD_OUT]
    fitted = [w for index, w in enumerate(windows) if (index + 1) % _HELD_OUT]
    before = {name: _of_scene(records[0].scene, name) for name in names}
    with Progress(most_evaluations(names), 'calibrate', unit='evaluation') as progress:
        problem = MaterialFit(simulator, fitted, before, progress)
        start = problem.scan()
        identified = problem.identifiable(start)
        values = problem.solve({k: v for k, v in start.items() if k in identified})
        errors = problem.errors(values)
        while (least := _least_known(errors)) is not None:
            # with this one fixed the others may be well determined: as of two whose product is
            # known
            identified.remove(least)
            values = problem.solve({k: v for k, v in values.items() if k in identified})
            errors = problem.errors(values)
    materials = {
        name: Fitted(
            value=values.get(name, before[name]),
            error=errors.get(name),
            before=before[name],
            told=name in identified,
        )
        for name in names
    }
    after = {name: material.value for name, material in materials.items()}
    noise = noise_of(records)
    judged = held or fitted
    return Calibration(
        materials=materials,
        windows=(len(fitted), len(held)),
        steps=steps,
        noise=asdict(noise),
        position_error=(
            _mean_error(simulator, judged, before),
            _mean_error(simulator, judged, after),
        ),
    )


def _check(
    simulator: Simulator, records: Sequence[Record], names: Sequence[str], steps: int
) -> None:
    if simulator.kind != 'laws':
        raise UserError(
            f'model {simulator.name!r} is a {simulator.kind}, which takes no materials; fit those '
            'of the laws, or fine-tune its weights: rigid-gns train --from'
        )
    if unknown := sorted(set(names) - set(MATERIALS)):
        raise UserError(f'unknown material {unknown[0]!r}, allowed: {", ".join(MATERIALS)}')
    if not names or not records or steps < 2:
        raise UserError(
            f'{len(names)} materials, {len(records)} records, windows of {steps} steps: expected '
            'at least one material, one record and two steps'
        )
    for record in records:
        native = simulator.native_dt(record.scene)
        if abs(record.trajectory.dt - native) > 1e-3 * native:
            raise UserError(
                f'record {record.name!r} has a time step of {record.trajectory.dt:.4g} s, but the '
                f'model has {native:.4g} s for its radius and gravity; import it without --dt'
            )


def _least_known(errors: dict[str, float]) -> str | None:
    """Material with the largest excess of error, the last of equal ones; None: none has any."""
    excess = {name: error / MATERIALS[name].known for name, error in errors.items()}
    least = max(reversed(excess), key=excess.__getitem__, default=None)
    return least if least is not None and excess[least] > 1.0 else None


def _of_scene(scene: Scene, name: str) -> float:
    if name.startswith('surface_'):
        return float(np.mean(scene.surface_values(name.removeprefix('surface_'))))
    return float(np.mean(getattr(scene, name)))


def _mean_error(
    simulator: Simulator, windows: Sequence[Window], values: dict[str, float]
) -> float:
    ends = []
    for window in windows:
        position_errors, _ = deviations(simulator, window, values)
        ends.append(np.linalg.norm(position_errors[-1], axis=-1)[window.position_weights[-1] > 0])
    return float(np.mean(np.concatenate(ends)))
