# SPDX-License-Identifier: Apache-2.0
"""Fits the base model, and the effects it has, to measurements."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.fitting.compare import Comparison, comparison
from twinmill.fitting.floor import acting_gains
from twinmill.fitting.heldout import HeldOut
from twinmill.fitting.opening import (
    Opened,
    judged,
    lag_is_kept,
    lateness_changes,
    of_few_commands,
    open_measurements,
)
from twinmill.fitting.score_fit import ScoreFit
from twinmill.model.model_file import ModelError, ModelFile
from twinmill.model.parameters import (
    BASE_GAINS,
    CLOCK,
    CLOCK_RATE,
    LAG,
    Parameter,
    ParameterEstimate,
    all_effect_parameters,
    base_lag_is_identifiable,
    base_parameters,
    begun_about,
    duty_table,
    gains_of,
)
from twinmill.predict.steady_states import SteadyStates

AGREE_SIGMA = 5.0  # clock offsets of several logs that differ by less are one


@dataclass(frozen=True)
class FitResult:
    """What a fit did.

    Attributes:
        before, after: comparisons over the same floors.
        heldout: errors on parts of the data that were not fitted to.
        parameters: estimates.
        clock: offset that all logs share, or None.
        path: of the new model.
        notes: sentences on where it holds.
    """

    before: Comparison
    after: Comparison
    heldout: HeldOut
    parameters: list[ParameterEstimate]
    clock: ParameterEstimate | None
    path: Path
    notes: tuple[str, ...] = ()

    def to_json(self) -> dict:
        """The interface's object."""
        return {
            "model": str(self.path),
            "score_before": self.before.score,
            "score_after": self.after.score,
            "heldout_after": self.heldout.score,
            "parameters": [e.to_json() for e in self.parameters],
            "time_offset_s": self.clock.value if self.clock else None,
            "notes": list(self.notes),
        }


def without_held(free: Sequence[Parameter], held: Collection[str]) -> list[Parameter]:
    """The quantities but for those that keep their values.

    Raises:
        ModelError: one that is to be held is not among them.
    """
    names = [p.name for p in free]
    for name in held:
        if name not in names:
            raise ModelError(
                f"{name}: is not fitted, so it is held anyway; {', '.join(names)} are."
            )
    return [p for p in free if p.name not in held]


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
    steady = isinstance(own.data, SteadyStates)
    return gains_of(model) if steady else acting_gains(own.data, model)


def _of_wheels(own: Opened) -> bool:
    """Whether it is a bench test, which tells speeds of wheels and no motion."""
    return isinstance(own.data, SteadyStates) and own.data.measurement.of_wheels


def fitted(
    opened: Sequence[Opened], free: Sequence[Parameter], fresh: Sequence[Parameter] = ()
) -> tuple[list[Opened], ScoreFit]:
    """The measurements with their models fitted together; never to a worse score.

    Those without a floor get the shared quantities alone. The fit begins at the best of several
    strengths of what is `fresh`.
    """
    known = judged(opened)
    data, models = [o.data for o in known], [o.model for o in known]
    near = ScoreFit(data, models, free).nearer()
    fit = ScoreFit(data, models, begun_about(free, near))
    if fresh:
        fit.begin_at_best(fresh)
    fit.fit()
    models = iter(fit.models)
    moved = [replace(o, model=next(models)) if o.data is not None else o for o in opened]
    shared = {e.name: e.value for e in fit.shared_values}
    for own in moved:
        if own.data is None:
            for name, value in shared.items():
                own.model.set(name, value)
    return moved, fit


def fit(
    measurements: Sequence[Measurement],
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
        ModelError: the new file cannot be written, or `held` names what is not fitted.
    """
    from twinmill.model.child_file import Fitted, write_child  # slow to import, for a fit alone

    opened = open_measurements(measurements, model_file)
    model = model_file.model
    kept = lag_is_kept(judged(opened), _told(model_file, measurements))
    names = [n for n in base_names(model, judged(opened)) if n != LAG or not kept]
    base = base_parameters(model, names)
    free = without_held([*base, *effects_free(model, judged(opened))], held)
    moved, found = fitted(opened, free)
    before = comparison(model_file, opened)
    after = comparison(model_file, [o.realigned() for o in moved], Path(out).name)
    estimates = [*found.shared_estimates(), *found.first_phases]
    clock = common_clock(found)
    heldout = HeldOut.of(found)
    few = of_few_commands(judged(opened))
    notes = (*([few] if few else []), *time_notes(judged(opened), unsteady_clocks(found), kept))
    write_child(  # last, so that Ctrl-C leaves no file of which nothing is told
        model_file,
        Fitted(
            model=with_estimates(model, estimates),
            estimates=[e for e in estimates if e.seen],
            logs={m.log_name: m.log_sha256 for m in measurements},
            score_before=before.score,
            score_after=after.score,
            noise=noise_of(after),
            clock=clock,
            covariance=found.shared_covariance(),
        ),
        out,
        command,
        force=force,
    )
    return FitResult(before, after, heldout, estimates, clock.get(CLOCK), Path(out), notes)


def _told(model_file: ModelFile, measurements: Sequence[Measurement]) -> Collection[str]:
    """Names of what other logs told of the base."""
    return model_file.known_from_other_logs([m.log_sha256 for m in measurements])


def noise_of(after: Comparison):
    """Of the first log that has a score; None of tables."""
    logs = (r.modelled for r in after.robots if r.modelled.noise and np.isfinite(r.score))
    return next((log.noise_at_speed for log in logs), None)


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
    own = [d.measurement for d in fit.datasets if CLOCK in {p.name for p in d.own}]
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
