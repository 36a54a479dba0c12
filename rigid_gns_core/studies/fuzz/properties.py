# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""All properties of a case that need no reference."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from .comparisons import chaos_of, Engines, not_converged, other_motion
from .failure import Failure
from .laws import broken_laws
from .scenes import Case
from ...scenes.sampling import sample_start
from ...scenes.scene_file import load_start, write_start


def check(case: Case, engines: Engines) -> list[Failure]:
    """All properties that a case breaks; only 'finite' where its own trajectory diverges."""
    path = engines.default(case.scene, case.start, case.steps)
    if path.diverged_at is not None:
        return [Failure('finite', np.inf, 0.0, f'not finite in frame {path.diverged_at}')]
    chaos = chaos_of(case, path, engines.default)
    return [
        *other_motion(case, path, chaos, engines.default),
        *not_converged(case, path, chaos, engines),
        *broken_laws(case, path),
        *changed_by_file(case),
    ]


def changed_by_file(case: Case) -> Iterator[Failure]:
    """Whether the scene and its start are others once written to a file and read back."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / 'scene.yaml'
        write_start(path, case.scene, case.start)
        scene, recipe = load_start(path)
    start = sample_start(scene, recipe)
    names = ('positions', 'quaternions', 'velocities', 'angular_velocities')
    apart = max(
        float(np.abs(getattr(start, name) - getattr(case.start, name)).max()) for name in names
    )
    if scene != case.scene or apart > 0:
        what = 'start' if scene == case.scene else 'scene'
        yield Failure('file', apart, 0.0, f'the {what} is another when read back')
