# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Terms of the laws, one by one: each stays only where left-out tracks are predicted better."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .correction_fit import CorrectionFit, Missed, missed_by
from .joint_fit import Fitted, JointFit
from .left_out import CLOSE, Forecast, forecasts, Part, scores, table_row, USUAL
from .noise_fit import fit_noise, known_stretches
from .parameters import Laws
from .problem import SpinPrior
from .spins import broad_prior, learned_prior
from .stretches import Stretch
from ..running.threads import in_threads, usable_cores
from ..tracking.start_correction import StartCorrection
from ..tracking.start_prior import StartPrior

# rounds of parameters and prior in turn, when spins are learned
_ROUNDS = 2
# a term that is not of the core lowers the logarithm of the error by this at least
_WORTH = 0.003
# a correction of starts is tried with so many of them
_FEWEST_STARTS = 20
# fits to known stretches, each with what the one before shows of them
_TRIMS = 2
# frames of this time before the last count in an estimate [s]
MEMORY = 0.4


@dataclass(frozen=True)
class Setup:
    """What is fitted, and how.

    Args:
        names: Parameters.
        spin: `none`: balls do not spin, or roll; `broad`: any spin; `learned`: as in other
            tracks.
        bandwidth: Of the prior, see `StartPrior`; infinite: all windows count alike.
        noise: s, q, kappa.
        memory: Frames of this time before the last count in an estimate [s].
    """

    names: tuple[str, ...]
    spin: str
    bandwidth: float
    noise: tuple[float, float, float]
    memory: float = MEMORY


def always(setup: Setup) -> bool:  # noqa: ARG001
    """Whether a term makes sense: it always does."""
    return True


@dataclass(frozen=True)
class Rung:
    """A term that is tried.

    Args:
        name: For the table.
        change: The setup with it.
        needs: Whether it makes sense with what was kept.
        bars: Error bars by which a removal must predict better.
    """

    name: str
    change: Callable[[Setup], Setup]
    needs: Callable[[Setup], bool] = always
    bars: float = 0.0


@dataclass(frozen=True)
class Tried:
    """A line of the table.

    Args:
        name: Term.
        kept: Whether it stayed.
        change: Mean change of the logarithm of the left-out error, over tracks.
        deviation: Its standard error.
        first, every: Left-out errors from first windows and from all, see `table_row`.
    """

    name: str
    kept: bool
    change: float
    deviation: float
    first: dict[str, list[float]]
    every: dict[str, list[float]]


@dataclass
class Fold:
    """One part of the tracks to fit to and the others to predict."""

    inside: list[Stretch]
    outside: list[Stretch]
    fitted: Fitted | None = None
    prior: StartPrior | None = None

    def part(self) -> Part:
        """What the others are predicted with, once it is fitted."""
        assert self.fitted is not None
        return Part(self.fitted.values, self.prior, self.outside)


@dataclass
class Ladder:
    """The search over terms.

    Args:
        laws: Laws as functions of parameters.
        folds: Tracks to fit to and to predict.
        setup: What is kept so far.
        table: What was tried.
        best: Left-out forecasts of what is kept.
        visited: Setup, folds and forecasts of all that was kept on the way.
        correction: Of starts, where it was worth it.
        together: Whether the tracks of a fold are of one time, and alike: then none of them is in
            the correction of another.
    """

    laws: Laws
    folds: list[Fold]
    setup: Setup
    table: list[Tried] = field(default_factory=list)
    best: list[Forecast] = field(default_factory=list)
    visited: list[tuple[Setup, list[Fold], list[Forecast]]] = field(default_factory=list)
    correction: CorrectionFit | None = None
    together: bool = False

    def begin(self) -> None:
        """Predict with what the scene says."""
        self.best = self._predict(self.setup, self.folds)
        self.visited.append((self.setup, [replace(fold) for fold in self.folds], self.best))
        self._note('as given', True, 0.0, 0.0, self.best)

    def add(self, rung: Rung) -> None:
        """Add a term, whatever it does: what it is worth shows when the others are there."""
        self._try(rung, np.inf, 0.0)

    def climb(self, rung: Rung) -> bool | None:
        """Add a term if left-out tracks are predicted better by more than the error bar."""
        return self._try(rung, -_WORTH, 1.0)

    def drop(self, rung: Rung) -> bool | None:
        """Take a term out if left-out tracks are predicted no worse, or better, without it."""
        return self._try(rung, 0.0, rung.bars)

    def _try(self, rung: Rung, most: float, bars: float) -> bool | None:
        """Whether a change of the error, with some error bars, is `most` at most; None: no change.

        Then it stays.
        """
        if not rung.needs(self.setup):
            return None
        setup = rung.change(self.setup)
        if setup == self.setup:
            return None
        folds = [replace(fold) for fold in self.folds]
        found = self._predict(setup, folds)
        change, deviation = paired(found, self.best, setup.noise[0])
        kept = change + bars * deviation <= most
        self._note(rung.name, kept, change, deviation, found)
        if kept:
            self.setup, self.folds, self.best = setup, folds, found
            self.visited.append((setup, folds, found))
        return kept

    def correct(self) -> bool | None:
        """Correct starts by what forecasts of other left-out tracks missed, as `climb` a term.

        All that is kept of the laws is kept: this is learned on top of it, and judged by close
        windows, short ones, too. None: too few starts.
        """
        noise, memory = np.array(self.setup.noise), self.setup.memory
        missed: list[Missed] = []
        for fold in self.folds:
            missed += missed_by(self.laws, fold.part(), noise, memory)
        if len(missed) < _FEWEST_STARTS or self.setup.spin == 'none':
            return None
        correction = CorrectionFit(missed, self.setup.noise[0])
        before, after = self.drawn(None, CLOSE), self.drawn(correction, CLOSE)
        change, deviation = paired(after, before, noise[0])
        if worth := change + deviation <= -_WORTH:
            self.correction = correction
        self._note('correction of starts', worth, change, deviation, self.drawn(correction))
        return worth

    def drawn(
        self,
        correction: CorrectionFit | None,
        spacing: tuple[float, float, int] = USUAL,
        samples: int = 0,
    ) -> list[Forecast]:
        """Left-out forecasts of the terms kept.

        Args:
            correction: Of starts: of each track by that of the others, or of other folds.
            spacing: Of the windows, see `left_out`.
            samples: Number of states drawn for their covariances; 0: by slopes.
        """
        found = []
        for fold in self.folds:
            own = None if correction is None else correction.without
            if correction is not None and self.together:
                others = correction.without(*{one.track for one in fold.outside})
                own = _of_any(others)
            found += forecasts(
                self.laws,
                fold.part(),
                np.array(self.setup.noise),
                self.setup.memory,
                samples=samples,
                correction=own,
                spacing=spacing,
            )
        return found

    def settle(self) -> bool:
        """Go back to what predicted left-out tracks best on the way; whether that was earlier.

        Few tracks tell few terms: what was added may be more than they bear.
        """
        noise = self.setup.noise[0]
        changes = [paired(found, self.best, noise)[0] for _, _, found in self.visited]
        least = int(np.argmin(changes))
        if changes[least] >= -_WORTH:
            return False
        self.setup, self.folds, self.best = self.visited[least]
        self._note('back to the best', True, changes[least], 0.0, self.best)
        return True

    def refit_noise(self) -> bool | None:
        """Noise and drift anew from the residuals of the first fold, if that is no worse."""
        fold = self.folds[0]
        fit = JointFit(self.laws, fold.inside, np.array(self.setup.noise), self._prior_of(fold))
        assert fold.fitted is not None
        position, drift, impact = (float(value) for value in fit_noise(fit, fold.fitted))
        noise = (position, drift, impact)
        return self.drop(Rung('noise and drift', lambda setup: replace(setup, noise=noise)))

    def _predict(self, setup: Setup, folds: Sequence[Fold]) -> list[Forecast]:
        def predict(fold: Fold) -> list[Forecast]:
            fold.fitted, fold.prior, _ = fit_setup(self.laws, setup, fold.inside, fold.fitted)
            return forecasts(self.laws, fold.part(), np.array(setup.noise), setup.memory)

        # compiled code does most of it, and releases the interpreter
        parts = in_threads(predict, folds, usable_cores())
        return [one for found in parts for one in found]

    def _prior_of(self, fold: Fold) -> SpinPrior | None:
        if self.setup.spin == 'none' or fold.prior is None:
            return None
        prior = fold.prior
        return lambda _, guess: prior.at(guess[:3], guess[3:])

    def _note(
        self, name: str, kept: bool, change: float, deviation: float, found: list[Forecast]
    ) -> None:
        first, every = table_row(found, True), table_row(found, False)
        self.table.append(Tried(name, kept, change, deviation, first, every))


def paired(
    found: Sequence[Forecast], before: Sequence[Forecast], noise: float
) -> tuple[float, float]:
    """Mean change of the tracks' scores, and its standard error."""
    new, old = scores(found, noise), scores(before, noise)
    changes = np.array([new[track] - old[track] for track in new if track in old])
    deviation = float(changes.std(ddof=1) / np.sqrt(len(changes))) if len(changes) > 1 else np.inf
    return float(changes.mean()), deviation


def fit_setup(
    laws: Laws, setup: Setup, found: Sequence[Stretch], before: Fitted | None
) -> tuple[Fitted, StartPrior | None, int]:
    """Joint fit of a setup, the prior that its spins make, and how many stretches it left out."""
    parameters = [laws.start_of(name) for name in setup.names]
    values = {} if before is None else {n: v for n, v in before.values.items() if n in setup.names}
    starts = None if before is None else before.starts
    scan = True
    noise = np.array(setup.noise)
    radius = laws.models[0].radius
    spin = None if setup.spin == 'none' else broad_prior(radius)
    fitted, start_prior = None, None
    for _ in range(_ROUNDS if setup.spin == 'learned' else 1):
        fit = JointFit(laws, found, noise, spin)
        if fitted is not None:
            values, starts = fitted.values, fitted.starts
        fitted = fit.fit((), {**{p.name: p.start for p in parameters}, **values}, starts)
        for _trim in range(_TRIMS):
            known = np.flatnonzero(known_stretches(fitted))
            fitted = fit.fit_known(parameters, fitted, known, scan)
            scan = False
            if np.array_equal(np.flatnonzero(known_stretches(fitted)), known):
                break
        if setup.spin == 'none':
            break
        start_prior, tracks = learned_prior(laws, fitted, found, setup.bandwidth)
        if setup.spin == 'broad':
            start_prior = StartPrior.of_any_spin(radius)
        else:
            spin = _without_own(start_prior, tracks)
    assert fitted is not None
    return fitted, start_prior, len(found) - int(known_stretches(fitted).sum())


def _of_any(correction: StartCorrection) -> Callable[[int], StartCorrection]:
    return lambda _: correction


def _without_own(prior: StartPrior, tracks: NDArray[np.int64]) -> SpinPrior:
    return lambda one, guess: prior.at(guess[:3], guess[3:], tracks == one.track)
