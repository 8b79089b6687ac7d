# SPDX-License-Identifier: Apache-2.0
"""Fits the base model, and the effects it has, to measurements."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.chance import t_quantile
from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.estimation.opened import Opened
from twinmill.estimation.refit import acting_gains
from twinmill.estimation.score_fit import ScoreFit
from twinmill.estimation.settings import FIT_SETTINGS, FitSettings
from twinmill.fitting.compare import Comparison, RobotComparison, comparison
from twinmill.fitting.heldout import HeldOut
from twinmill.fitting.opening import (
    judged,
    lag_is_kept,
    lateness_changes,
    of_few_commands,
    open_measurements,
)
from twinmill.fitting.residuals import Residuals, residuals_of
from twinmill.model.covariance import Covariance
from twinmill.model.model_file import ModelError, ModelFile, quantity_names
from twinmill.model.parameters import (
    ALIGNMENT,
    BASE_GAINS,
    CLOCK,
    CLOCK_RATE,
    LAG,
    NORMAL_95,
    Parameter,
    ParameterEstimate,
    all_effect_parameters,
    base_lag_is_identifiable,
    base_parameters,
    begun_about,
    duty_table,
    gains_of,
)
from twinmill.predict.datasets import Trajectory
from twinmill.predict.noise import Noise
from twinmill.predict.steady_states import SteadyStates

AGREE_SIGMA = 5.0  # clock offsets of several logs that differ by less are one


@dataclass(frozen=True)
class Statistics:
    """How the estimates of a fit scatter, and what it leaves.

    Attributes:
        covariance: of all that was fitted; its diagonal is the square of each `std`.
        degrees: of freedom of Student's t in the intervals: blocks less one.
        log_likelihood: of errors over floors, at the best scale of each data set.
        nobs: number of independent errors, which is less than that of residuals.
        converged: the fit ended before its last round.
        residuals: of each data set.
    """

    covariance: Covariance
    degrees: int
    log_likelihood: float
    nobs: float
    converged: bool
    residuals: list[Residuals]

    @classmethod
    def of(cls, fit: ScoreFit) -> "Statistics":
        """Statistics of a finished fit."""
        return cls(
            fit.whole_covariance,
            max(fit.blocks - 1, 1),
            fit.log_likelihood,
            float(fit.sizes.sum()),
            fit.converged,
            residuals_of(fit),
        )

    def half_width(self, std: np.ndarray, alpha: float) -> np.ndarray:
        """Half an interval of that chance to miss; `std` is half of one of 95 % over 1.96."""
        wider = t_quantile(1 - alpha / 2, self.degrees) / t_quantile(0.975, self.degrees)
        return NORMAL_95 * wider * std


@dataclass(frozen=True)
class Held:
    """A quantity that a fit could have moved, and that kept the value of the model as given.

    Attributes:
        words: as of a `Parameter`.
    """

    name: str
    value: float
    unit: str
    words: str = ""

    def to_json(self) -> dict[str, Any]:
        """Fields of the interface."""
        return {"name": self.name, "value": self.value, "unit": self.unit}


@dataclass(frozen=True)
class FitResult:
    """Result of a fit.

    Attributes:
        before, after: comparisons over the same floors.
        heldout: errors on parts of the data that were not fitted to.
        parameters: estimates.
        clock: offset that all logs share, or None.
        child: the new model.
        statistics: how the estimates scatter, and what is left.
        notes: sentences on where it holds.
        held: what kept its value because the fit's choice says so.
    """

    before: Comparison
    after: Comparison
    heldout: HeldOut
    parameters: list[ParameterEstimate]
    clock: ParameterEstimate | None
    child: ModelFile
    statistics: Statistics
    notes: tuple[str, ...] = ()
    held: tuple[Held, ...] = ()

    @property
    def path(self) -> Path:
        """Path of the new model."""
        return self.child.path

    def to_json(self) -> dict[str, Any]:
        """The interface's object."""
        return {
            "model": str(self.path),
            "score_before": self.before.score,
            "score_after": self.after.score,
            "heldout_after": self.heldout.score,
            "parameters": [e.to_json() for e in self.parameters],
            "held": [h.to_json() for h in self.held],
            "time_offset_s": self.clock.value if self.clock else None,
            "notes": list(self.notes),
        }


@dataclass(frozen=True)
class Choice:
    """Free parameters of a fit, and their priors.

    Attributes:
        hold: names that keep their values: quantities, or effects and tables as a whole.
        free: likewise, what alone is moved; None: all that the measurements move.
        priors: mean and standard deviation by name, in place of the usual ones.
    """

    hold: Collection[str] = ()
    free: Collection[str] | None = None
    priors: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def of(self, usual: Sequence[Parameter], model: native.Model) -> list[Parameter]:
        """Parameters to fit, chosen from the usual ones.

        Raises:
            ModelError: a name is of nothing that a fit of the motion can move, is to be free and
                held, or has a prior and is not free.
        """
        known = quantity_names(model)
        for name in (*self.hold, *(self.free or ()), *self.priors):
            _check_name(name, known)
        for name in self.free or ():
            if _among(name, self.hold):
                raise ModelError(f"{name}: is in `free` and is held; name it in one of them.")
        chosen = list(usual)
        if self.free is not None:
            others = [n for n in known if n.startswith(MOTION) and _among(n, self.free)]
            others = [n for n in others if n not in {p.name for p in usual}]
            chosen = [p for p in usual if _among(p.name, self.free)]
            chosen += base_parameters(model, sorted(others))
            for name in self.free:
                if not any(_among(p.name, (name,)) for p in chosen):
                    raise ModelError(f"{name}: moves nothing in these measurements; leave it out.")
        moved = [p for p in chosen if not _among(p.name, self.hold)]
        self._check_priors([p.name for p in moved])
        return [self._informed(p) for p in moved]

    def _check_priors(self, moved: Collection[str]) -> None:
        """Raises ModelError where a prior is of nothing that is moved."""
        for name in self.priors:
            if name in moved:
                continue
            if _among(name, self.hold):
                raise ModelError(f"{name}: has a prior and is held; leave one of them out.")
            raise ModelError(
                f"{name}: has a prior and is not fitted; name it in `free`, with all else that is "
                f"to be fitted (without a choice these are: {', '.join(moved)})."
            )

    def held(self, usual: Sequence[Parameter], model: native.Model) -> tuple[Held, ...]:
        """Quantities that keep their values by this choice, in the order of the usual ones.

        They are those that would be fitted without it; then others that it holds by their own
        names, not with a table as a whole.
        """
        names = [p.name for p in usual if not self._moves(p.name)]
        units = {v["name"]: v["unit"] for v in model.values()}
        others = [n for n in sorted(units) if n in self.hold and n not in names]
        words = {p.name: p.words for p in usual}
        return tuple(Held(n, model.get(n), units[n], words.get(n, "")) for n in (*names, *others))

    def _moves(self, name: str) -> bool:
        return not _among(name, self.hold) and (self.free is None or _among(name, self.free))

    def _informed(self, p: Parameter) -> Parameter:
        """With its prior."""
        if p.name not in self.priors:
            return p
        mean, std = self.priors[p.name]
        if not (std > 0 and p.min <= mean <= p.max):
            raise ModelError(
                f"{p.name}: a prior of {mean:g} +- {std:g} cannot be; its mean must be within "
                f"{p.min:g} to {p.max:g} and its standard deviation above 0."
            )
        return replace(p, usual=float(mean), std=float(std), prior=True)


MOTION = ("base.", "robot.")  # sections whose numbers say how a robot moves


def _among(name: str, given: Collection[str]) -> bool:
    """True if the names have a quantity, or the effect or table that it is part of."""
    return any(name == g or name.startswith(f"{g}.") for g in given)


def _check_name(name: str, known: Collection[str]) -> None:
    if name in ALIGNMENT:
        raise ModelError(
            f"{name}: is of each log, not of the robot; say of a log that one clock stamped it."
        )
    if not any(_among(k, (name,)) for k in known):
        (near,) = get_close_matches(name, sorted(known), n=1, cutoff=0)
        raise ModelError(f"{name}: the model has no such quantity; the nearest is {near}.")


def base_names(
    model: native.Model, opened: Sequence[Opened], told: Collection[str] = ()
) -> list[str]:
    """Gains, duty table and lag of the base that these measurements move.

    Args:
        model: whose base it is.
        opened: measurements.
        told: names of what other logs told; of these only the gains are free, since batteries and
            floors change. Without any, the speeds of the duty table stand for the forward gain;
            wheels on a bench tell them apart from it.
    """
    acting = {n for o in opened for n in _gains(o, model)}
    gains = [n for n in BASE_GAINS if n in acting]
    bench = [_of_wheels(o) for o in opened]
    table = [] if told and not all(bench) else duty_table(model)
    if any(bench):
        gains = [*table, *gains]
    elif len(table) > 1:
        gains = [*table, *(n for n in gains if n != BASE_GAINS[0])]
    kept = LAG in told or lag_is_kept(opened, told)
    changes = any(o.floor for o in opened) and not kept
    return [*gains, LAG] if changes and base_lag_is_identifiable(model) else gains


def effects_free(model: native.Model, opened: Sequence[Opened]) -> list[Parameter]:
    """Free quantities of a model's effects; no lateness where none of the logs tells one."""
    free = all_effect_parameters(model)
    return [p for p in free if p.role != "lateness"] if lateness_changes(opened) else free


def _gains(own: Opened, model: native.Model) -> list[str]:
    """Gains of the base that this measurement moves."""
    if _of_wheels(own):
        return []
    if isinstance(own.data, Trajectory):
        return acting_gains(own.data, model)
    return gains_of(model)


def _of_wheels(own: Opened) -> bool:
    """True for a bench test, which has speeds of wheels and no motion."""
    return isinstance(own.data, SteadyStates) and own.data.measurement.of_wheels


def fitted(
    opened: Sequence[Opened],
    free: Sequence[Parameter],
    fresh: Sequence[Parameter] = (),
    *,
    informed: Collection[str] = (),
    settings: FitSettings = FIT_SETTINGS,
) -> tuple[list[Opened], ScoreFit]:
    """The measurements with their models fitted together; never to a worse score.

    Those without a floor get the shared quantities alone. The fit begins at the best of several
    strengths of what is `fresh`.

    Args:
        opened: measurements.
        free: what is fitted.
        fresh: what of it is new.
        informed: names of what has a prior of the user's own.
        settings: when the fit ends.
    """
    known = judged(opened)
    data, models = [o.data for o in known], [o.model for o in known]
    near = ScoreFit(data, models, free).nearer()
    near = {name: value for name, value in near.items() if name not in informed}
    fit = ScoreFit(data, models, begun_about(free, near))
    if fresh:
        fit.begin_at_best(fresh)
    fit.fit(settings.rounds, settings.tolerance)
    found = iter(fit.models)
    moved = [replace(o, model=next(found)) if o.data is not None else o for o in opened]
    shared = {e.name: e.value for e in fit.shared_values}
    for own in moved:
        if own.data is None:
            for name, value in shared.items():
                own.model.set(name, value)
    return moved, fit


def fit(
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    out: Path,
    command: str,
    *,
    held: Collection[str] = (),
    force: bool = True,
) -> FitResult:
    """Fits all free quantities of the model to all measurements and writes the new model.

    Args:
        measurements: what it is fitted to.
        model_file: the model.
        out: the new model file.
        command: recorded in it.
        held: names of quantities that keep their values.
        force: replace a file that has come to be there.

    Raises:
        LogError: no measurement can be judged.
        ModelError: the new file cannot be written, or `held` names no quantity.
    """
    result = fit_model(measurements, model_file, Path(out), command, choice=Choice(held))
    result.child.write(force)  # last, so that Ctrl-C leaves no file of which nothing is told
    return result


def fit_model(
    measurements: Sequence[Measurement | SteadyTable],
    model_file: ModelFile,
    path: Path,
    command: str,
    *,
    choice: Choice,
    settings: FitSettings = FIT_SETTINGS,
) -> FitResult:
    """Fits the model to all measurements; nothing is written.

    Args:
        measurements: what it is fitted to.
        model_file: the model.
        path: where the new model may be written.
        command: recorded in it.
        choice: what is fitted, and what is known of it.
        settings: when the fit ends.

    Raises:
        LogError: no measurement can be judged.
        ModelError: the choice names what cannot be fitted.
    """
    from twinmill.model.child_file import Fitted, child_of  # slow to import, for a fit alone

    opened = open_measurements(measurements, model_file)
    model = model_file.model
    kept = lag_is_kept(judged(opened), _told(model_file, measurements))
    names = [n for n in base_names(model, judged(opened)) if n != LAG or not kept]
    usual = [*base_parameters(model, names), *effects_free(model, judged(opened))]
    free = choice.of(usual, model)
    moved, found = fitted(opened, free, informed=choice.priors, settings=settings)
    before = comparison(model_file, opened)
    after = comparison(model_file, [o.realigned() for o in moved], path.name)
    estimates = [*found.shared_estimates(), *found.first_phases]
    clock = common_clock(found)
    few = of_few_commands(judged(opened))
    notes = (*([few] if few else []), *time_notes(judged(opened), unsteady_clocks(found), kept))
    told = Fitted(
        model=with_estimates(model, estimates),
        estimates=[e for e in estimates if e.seen],
        logs={m.log_name: m.log_sha256 for m in measurements},
        score_before=before.score,
        score_after=after.score,
        noise=noise_of(after),
        clock=clock,
        covariance=found.shared_covariance(),
    )
    child = child_of(model_file, told, path, command)
    return FitResult(
        *(before, after, HeldOut.of(found), estimates, clock.get(CLOCK)),
        child=child,
        statistics=Statistics.of(found),
        notes=notes,
        held=choice.held(usual, model),
    )


def _told(
    model_file: ModelFile, measurements: Sequence[Measurement | SteadyTable]
) -> Collection[str]:
    """Names of what other logs told of the base."""
    return model_file.known_from_other_logs([m.log_sha256 for m in measurements])


def noise_of(after: Comparison) -> Noise | None:
    """Noise of the first log with a score; None if there are tables alone."""
    logs = [r for r in after.robots if isinstance(r, RobotComparison) and np.isfinite(r.score)]
    return next((r.modelled.noise_at_speed for r in logs if r.modelled.noise), None)


def with_estimates(model: native.Model, estimates: Sequence[ParameterEstimate]) -> native.Model:
    """The model with estimates put in."""
    model = model.copy()
    for estimate in estimates:
        model.set(estimate.name, estimate.value)
    return model


def common_clock(fit: ScoreFit) -> dict[str, ParameterEstimate]:
    """Offset and rate that the logs share; empty if they differ, change, or were known before."""
    own = [fit.own_estimates(i) for i in range(len(fit.datasets))]
    if not own or not all(CLOCK in e for e in own) or unsteady_clocks(fit):
        return {}
    common = {}
    for name, least in ((CLOCK, 0.001), (CLOCK_RATE, 5.0)):
        values = np.array([e[name].value for e in own])
        stds = np.maximum(np.array([e[name].std for e in own]), 1e-9)
        weights = 1 / stds**2
        mean = float(np.sum(weights * values) / weights.sum())
        if np.any(np.abs(values - mean) > AGREE_SIGMA * np.hypot(stds, least)):
            return {}
        std = float(1 / np.sqrt(weights.sum()))
        common[name] = ParameterEstimate(name, mean, std, own[0][name].unit, False, True)
    return common


def unsteady_clocks(fit: ScoreFit) -> list[str]:
    """Labels of logs whose clocks are found, and whose offset changes within them."""
    logs = [d for d in fit.datasets if isinstance(d, Trajectory)]
    own = [d.measurement for d in logs if CLOCK in {p.name for p in d.own}]
    return [m.label for m in own if not m.steady]


def time_notes(opened: Sequence[Opened], unsteady: Collection[str], lag_kept: bool) -> list[str]:
    """A sentence where numbers of time are not fitted, since they hold for no other log.

    Args:
        opened: what is fitted to.
        unsteady: labels of logs within which the offset of the clocks changes.
        lag_kept: see `lag_is_kept`.
    """
    if changing := lateness_changes(opened):
        which = "Lag, delay and clock offset" if lag_kept else "Delay and clock offset"
        lag = "" if lag_kept else " The lag is fitted with that taken into account."
        return [
            f"{which} keep the values of the model as given: how late the robot follows its "
            f"commands changes within {', '.join(changing)}, and no one number of it holds for "
            f"another log.{lag}"
        ]
    if not unsteady:
        return []
    return [
        f"No clock offset is written into the model: within {', '.join(unsteady)} it changes, and "
        "holds for no other log."
    ]
