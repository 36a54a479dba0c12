# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Materials under which short rollouts meet tracked poses best.

From a start of tracked poses, the laws predict some steps; the errors, in units of what
the tracker's noise explains, are made least by Gauss-Newton steps
(`scipy.optimize.least_squares`), under a loss that grows with the logarithm, since a missed
collision says nothing of materials.
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
# every so many windows are held out, to judge by
_HELD_OUT = 5


@dataclass(frozen=True)
class Fitted:
    """One material.

    Args:
        value: The fitted one; the scene's where the data cannot tell it.
        error: Standard error, of the data and not of the model; None where the data cannot tell.
        before: The scene's.
        told: Whether the data tell it.
    """

    value: float
    error: float | None
    before: float
    told: bool


@dataclass(frozen=True)
class Calibration:
    """Fitted materials.

    Args:
        materials: By name.
        windows: Number of windows that were fitted, and held out.
        steps: Steps of a window.
        noise: Of the poses: position [m], rotation [rad] or None.
        position_error: Mean error after `steps` in held-out windows, of spheres whose start can be
            trusted, with the scene's materials and with the fitted ones [m].
    """

    materials: dict[str, Fitted]
    windows: tuple[int, int]
    steps: int
    noise: dict[str, float | None]
    position_error: tuple[float, float]

    @property
    def values(self) -> dict[str, float]:
        """Value of each material."""
        return {name: found.value for name, found in self.materials.items()}


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
        simulator: A model that takes materials.
        records: Tracked poses at the model's time step.
        names: What to fit, of `MATERIALS`.
        steps: Steps of a window: few, as errors grow with each collision.
        most: Largest number of windows; more are drawn from.
        seed: Of that draw.

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
        told = problem.told(start)
        values = problem.solve({k: v for k, v in start.items() if k in told})
        errors = problem.errors(values)
        while (least := _least_known(errors)) is not None:
            # without it the others may be known well: a product of two is told, but not both
            told.remove(least)
            values = problem.solve({k: v for k, v in values.items() if k in told})
            errors = problem.errors(values)
    materials = {
        name: Fitted(
            value=values.get(name, before[name]),
            error=errors.get(name),
            before=before[name],
            told=name in told,
        )
        for name in names
    }
    after = {name: found.value for name, found in materials.items()}
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
    """Material whose error is too large by most; of several the last."""
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
        places, _ = deviations(simulator, window, values)
        ends.append(np.linalg.norm(places[-1], axis=-1)[window.place_weights[-1] > 0])
    return float(np.mean(np.concatenate(ends)))
