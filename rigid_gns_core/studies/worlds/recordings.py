# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings of real balls as worlds: what is learned of them, judged on tracks left out.

A set is halved as in `rigid-gns benchmark recordings`. The laws are fitted to one half, and what
is learned beyond them is, too: the correction of starts, which `rigid-gns calibrate` learns, and a
residual network in the dynamics, for whose weights and strength a fifth of that half is held out.
All are judged by their forecasts of the other half.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
import shutil
from typing import Any
import warnings

import numpy as np
import yaml

from .baseline import gns_recipe, train_gns
from .study import WorldsBudget
from ..real_balls.judged import HORIZONS, protocols
from ..real_balls.recorded_sets import halves, imported_tracks, RecordedSet
from ...data.records import Dataset, Record
from ...data.tracks import TrackSet
from ...errors import UserError
from ...files.atomic_file import whole_file
from ...identification.learn import learn
from ...prediction.laws import UNITS
from ...prediction.load import load_simulator
from ...recordings.importing.import_bags import import_bags
from ...recordings.importing.options import ImportOptions
from ...recordings.scoring.track_errors import report_of, track_outcomes, Windows
from ...rollout.simulator import Simulator
from ...rollout.stepper import Stepper
from ...scenes.scene import Scene
from ...scenes.scene_file import load_scene
from ...scenes.similarity import Similarity
from ...scenes.state import State
from ...training.recipes import load_recipe
from ...training.residual.gate import held_out
from ...training.residual.learner import NothingToLearnError
from ...training.train import TrainConfig, Trainer

GIVEN, FITTED = 'laws given', 'laws fitted'
CORRECTED, RESIDUAL, GNS = 'laws fitted + correction', 'laws fitted + residual', 'GNS'


def run_recorded(
    one: RecordedSet, seed: int, budget: WorldsBudget, folder: Path
) -> list[dict[str, Any]]:
    """Results of a set and a split; trainings in `folder` are resumed.

    Args:
        one: The set.
        seed: Of the halves and of the trainings.
        budget: Changes to the trainings.
        folder: Tracks, fitted scenes and trainings of this split.

    Returns:
        For each protocol, that of the first window and that of windows all along, results as of
        `run_world`, without speeds: `errors` by rival and time ahead [m], and `counts` of
        forecasts by time ahead.

    Raises:
        UserError: There are too few tracks, or too short ones.
    """
    if one.tracks.is_dir():
        raise UserError(f'set {one.name} is a data set; give the CSV file that it was made of')
    found = imported_tracks(one, folder / 'tracks')
    inside, outside = halves(found, seed)
    if len(inside.tracks) + len(outside.tracks) > len(found.tracks):
        raise UserError(
            f'set {one.name} has {len(found.tracks)} tracks, too few to leave some out'
        )
    corrected = _fitted(inside, folder)
    assert corrected.tracker is not None
    fitted = replace(corrected, tracker=replace(corrected.tracker, correction=None))
    records = _records(one, fitted, inside, folder)
    train, validation = held_out(records, len(records) // 2)
    if not validation:
        raise UserError(f'set {one.name}: {len(records)} trajectories are too few to learn from')
    origin = f'recordings {one.name}'
    recipe = replace(load_recipe('residual'), seed=seed, **budget.changes)
    residual, training = _residual(recipe, train, validation, folder / 'residual', origin)
    plain, others = ([_plain(record) for record in part] for part in (train, validation))
    baseline = gns_recipe(budget.gns, seed)
    samples = _samples(fitted, train[0].trajectory.dt)
    gns, score = train_gns(plain, others, samples, baseline, folder / 'gns', origin)
    laws = load_simulator('laws')
    rivals: dict[str, tuple[Simulator, Scene]] = {
        GIVEN: (laws, found.scene),
        FITTED: (laws, fitted),
        CORRECTED: (laws, corrected),
        RESIDUAL: (residual or laws, fitted),
        GNS: (_Unturned(gns), fitted),
    }
    results = []
    for name, way in protocols(outside, seed).items():
        reports = {rival: _judged(*own, outside, way.windows) for rival, own in rivals.items()}
        results.append(
            {
                'world': f'{one.name}_{name}',
                'set': one.name,
                'starts': way.text,
                'seed': seed,
                'tracks': {'fitted': len(inside.tracks), 'judged': len(outside.tracks)},
                'errors': {
                    rival: {time: numbers['mean_m'] for time, numbers in report.items()}
                    for rival, report in reports.items()
                },
                'counts': {time: numbers['n'] for time, numbers in reports[FITTED].items()},
                'training': training,
                'gns': {'steps': baseline.steps, 'validation_score': score},
                'budget': asdict(budget),
            }
        )
    return results


def _residual(
    recipe: TrainConfig, train: list[Record], validation: list[Record], folder: Path, origin: str
) -> tuple[Simulator | None, dict[str, Any]]:
    """The laws with a residual network, None where no frame has a contact; and how it went."""
    try:
        trainer = Trainer(recipe, train, validation, folder, origin)
        best = trainer.run()
    except NothingToLearnError as error:
        return None, {'steps': 0, 'none': str(error)}
    compared = asdict(trainer.comparison) if trainer.comparison else {}
    told = {'steps': recipe.steps, 'validation_error': best, **compared}
    return load_simulator(folder / 'best'), told


class _Unturned(Simulator):
    """A GNS that begins without spin, as one of recordings without rotations was trained."""

    kind = 'unturned'
    velocities = 'poses'

    def __init__(self, simulator: Simulator) -> None:
        super().__init__(simulator.card, simulator.name, simulator.units)
        self.simulator = simulator

    def check(self, scene: Scene, count: int, *, stacklevel: int = 2) -> None:
        """See `Simulator.check`."""
        self.simulator.check(scene, count, stacklevel=stacklevel + 1)

    def stepper(self, scene: Scene, state: State) -> Stepper:
        """Stepper that starts from `state` without its spin."""
        still = replace(state, angular_velocities=np.zeros_like(state.angular_velocities))
        return self.simulator.stepper(scene, still)


def _judged(
    simulator: Simulator, scene: Scene, outside: TrackSet, windows: Windows
) -> dict[str, Any]:
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # of what a GNS does not know of the scene
        outcomes = track_outcomes(simulator, outside, scene, replace(windows, samples=0))
    return report_of([one for one in outcomes if not one.held], HORIZONS)


def _fitted(inside: TrackSet, folder: Path) -> Scene:
    """Laws fitted to the tracks, with the correction of starts; those of an earlier run."""
    path = folder / 'fitted.yaml'
    if not path.is_file():
        _write(path, learn(inside.tracks, inside.scene, inside.labels).scene)
    return load_scene(path)


def _write(path: Path, scene: Scene) -> None:
    text = yaml.safe_dump({'scene': scene.to_mapping()}, default_flow_style=None, width=110)
    with whole_file(path) as partial:
        partial.write_text(text, encoding='utf-8')


def _samples(scene: Scene, interval: float) -> int:
    """Samples of a tracker in a frame of the laws."""
    return max(1, round(UNITS.dt * Similarity.between(scene, UNITS).time / interval))


def _records(one: RecordedSet, scene: Scene, inside: TrackSet, folder: Path) -> list[Record]:
    """Trajectories of the tracks that are fitted, so many samples a frame as the tracker has."""
    frame = UNITS.dt * Similarity.between(scene, UNITS).time
    gaps = np.concatenate([np.diff(track.times) for track in inside.tracks])
    dt = frame / _samples(scene, float(np.median(gaps)))
    data, path = folder / 'frames', folder / 'laws.yaml'
    _write(path, scene)
    shutil.rmtree(data, ignore_errors=True)
    import_bags([one.tracks], data, ImportOptions(scene=path, dt=dt))
    names = {track.name for track in inside.tracks}
    return [record for record in Dataset(data) if record.teacher['track'] in names]


def _plain(record: Record) -> Record:
    """The record in a scene that the thesis' network knows: no air, one material, gravity down."""
    scene = record.scene
    down = (0.0, 0.0, -float(np.linalg.norm(scene.gravity)))
    surfaces = tuple(replace(surface, contact=None) for surface in scene.surfaces)
    bare = replace(
        scene, gravity=down, surfaces=surfaces, sphere_contact=None, air=None, tracker=None
    )
    return replace(record, scene=bare)
