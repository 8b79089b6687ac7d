# SPDX-License-Identifier: Apache-2.0
"""The model with what it lacked: base and effects at their posterior, in a file of its own.

Written is the likeliest set of missing effects, with what the base's own log shows beside it. An
effect that is of a moment of the log stays out, since no other log has it; so do effects none of
which is sure where predictions are no better with them. An unnamed cause is in
it where a formula describes it. The base's numbers are those beside what was found, so that they
do not stand for it.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import tomlkit

from twinmill.data.measurement import Measurement
from twinmill.diagnosis.fleet import Fleet
from twinmill.diagnosis.infer import Inference
from twinmill.fitting.compare import Comparison, comparison
from twinmill.fitting.fit import noise_of
from twinmill.fitting.opening import open_measurements
from twinmill.inference.duties import refined, written_on
from twinmill.inference.formula import Formula
from twinmill.inference.found_model import found_model, with_formula
from twinmill.inference.keeping import with_its_error
from twinmill.model.child_file import Fitted, child_of
from twinmill.model.model_file import ModelError, ModelFile
from twinmill.model.parameters import (
    CLOCK,
    CLOCK_RATE,
    ParameterEstimate,
    catalogue_name,
    instance_of,
    with_role,
)


@dataclass(frozen=True)
class Better:
    """A model file with what was found, not written yet.

    Attributes:
        file: of it, with what it still misses in these logs as [fit.always].
        added: instances of effects that the given model does not have.
        before, after: comparison of the two models with the logs.
        found: what was missing in the given one.
        estimates: of the new model's quantities.
    """

    file: ModelFile
    added: tuple[str, ...]
    before: Comparison
    after: Comparison
    found: Inference | Fleet
    estimates: list[ParameterEstimate]

    def to_json(self) -> dict[str, Any]:
        """Fields of `twinmill explain --json`."""
        return {
            "model": str(self.file.path),
            "added": list(self.added),
            "score": self.before.score,
            "score_after": self.after.score,
        }


def better(found: Inference, model_file: ModelFile, path: Path, command: str) -> Better:
    """The likeliest model, to be written.

    Args:
        found: in logs of one robot, or in tables.
        model_file: the model that was judged.
        path: of the new file.
        command: recorded in it.

    Raises:
        ModelError: the file gives this robot numbers of its own.
    """
    own = tomlkit.parse(model_file.text).get("robots", {})
    for robot in (f"R{m.robot_id:02d}" for m in found.measurements):
        if robot in own:
            raise ModelError(
                f"{model_file.path}: [robots.{robot}] has numbers of this robot alone, and a "
                f"better model is written for all; take that table out of a copy, and give the "
                f"copy."
            )
    forms = [found.formula, None] if found.formula and found.formula.lasting else [None]

    def judged(formula: Formula | None) -> tuple[Comparison, Fitted, tuple[str, ...]]:
        fitted, added = _fitted(found, model_file, found.before.score, formula)
        child = child_of(model_file, fitted, path, command)
        return comparison(child, open_measurements(found.measurements, child)), fitted, added

    after, fitted, added = min(map(judged, forms), key=lambda each: each[0].score)
    fitted = replace(fitted, score_after=after.score, noise=noise_of(after))
    child = child_of(model_file, fitted, path, command)
    kept = with_its_error(child, found.measurements)
    return Better(kept, added, found.before, after, found, fitted.estimates)


def _fitted(
    found: Inference, model_file: ModelFile, score: float, formula: Formula | None
) -> tuple[Fitted, tuple[str, ...]]:
    """Fit to be written, and its new instances of effects; the score is not known yet."""
    always = found.always.effects if found.always else ()
    lasting = [n for n in always if not with_role(n, "moment")]
    numbers = found.answer.numbers if found.holds or found.formula else found.answer.refit
    common = written_on(model_file, found.curved)
    own = found_model(common, numbers, [*lasting, *found.added])
    if formula:
        own = with_formula(own, formula)
    kept = [e for e in own.estimates if instance_of(e.name) != "clock"]
    clock = {e.name: e for e in own.estimates if e.name in (CLOCK, CLOCK_RATE)}
    logs = [m for m in found.measurements if isinstance(m, Measurement)]
    declared = own.model.clock_same or any(m.same_clock for m in logs)
    if declared or len(logs) != 1:  # several logs may have an offset each, and a table has none
        clock = {}
    told = {f.effect: f.share for f in found.answer.findings}
    fitted = Fitted(
        model=own.model,
        estimates=kept,
        logs={m.log_name: m.log_sha256 for m in found.measurements},
        score_before=score,
        score_after=score,
        clock=clock,
        covariance=own.covariance.of([*(e.name for e in kept), *clock]),
        shares={n: told[catalogue_name(n)] for n in own.added if catalogue_name(n) in told},
        duty_pct=refined(model_file).duty_pct if found.curved else (),
    )
    return fitted, own.added
