# SPDX-License-Identifier: Apache-2.0
"""Adds an effect to a model: fitted together with the base, judged on data it was not fitted to."""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from twinmill.data.measurement import Measurement
from twinmill.fitting.compare import Comparison, comparison
from twinmill.fitting.fit import (
    base_names,
    common_clock,
    fitted,
    noise_of,
    with_estimates,
    without_held,
)
from twinmill.fitting.heldout import HeldOut
from twinmill.fitting.opening import judged, open_measurements
from twinmill.model.model_file import Fitted, ModelFile, write_child
from twinmill.model.parameters import (
    ParameterEstimate,
    all_effect_parameters,
    base_parameters,
    effect_names,
    effect_parameters,
)


@dataclass(frozen=True)
class AddResult:
    """What adding an effect did.

    Attributes:
        before: comparison of the model as given; after: with the effect, all refitted.
        heldout_before: the model as given.
        heldout_refit: its quantities refitted without the effect.
        heldout_after: refitted with it.
    """

    effect: str
    before: Comparison
    after: Comparison
    parameters: list[ParameterEstimate]
    heldout_before: HeldOut
    heldout_refit: HeldOut
    heldout_after: HeldOut
    path: Path

    def to_json(self) -> dict:
        """The interface's object."""
        return {
            "effect": self.effect,
            "model": str(self.path),
            "score_before": self.before.score,
            "score_after": self.after.score,
            "heldout_before": self.heldout_before.score,
            "heldout_refit": self.heldout_refit.score,
            "heldout_after": self.heldout_after.score,
            "parameters": [e.to_json() for e in self.parameters],
            "heldout_errors_before": self.heldout_before.rows(),
            "heldout_errors_after": self.heldout_after.rows(),
        }


def add(
    effect: str,
    measurements: list[Measurement],
    model_file: ModelFile,
    out: Path,
    command: str,
    texts: dict[str, str] | None = None,
    held: Collection[str] = (),
) -> AddResult:
    """Adds an effect and writes the new model.

    Args:
        effect: its name.
        measurements: what it is fitted to.
        model_file: the model that lacks it.
        out: the new model file.
        command: recorded in it.
        texts: the effect's formula and the like, by name.
        held: names of quantities that keep their values.

    Raises:
        ValueError: no such effect, it is made for another drive, or a text makes no sense.
        ModelError: the new file cannot be written, or `held` names what is not fitted.
    """
    richer = model_file.model.copy()
    richer.add_effect(effect, texts or {})
    name = effect_names(richer)[-1]
    opened = open_measurements(measurements, model_file)
    logs = {m.log_name: m.log_sha256 for m in measurements}
    told = model_file.known_from_other_logs(logs.values())
    base = base_parameters(model_file.model, base_names(model_file.model, judged(opened), told))
    old = without_held([*base, *all_effect_parameters(model_file.model)], held)
    fresh = effect_parameters(richer, name, fresh=True)
    grown = [o.with_model(richer) for o in opened]
    moved, found = fitted(grown, [*old, *fresh], fresh=len(fresh))
    held = [HeldOut.of(f) for f in (fitted(opened, [])[1], fitted(opened, old)[1], found)]
    before = comparison(model_file, opened)
    after = comparison(model_file, [o.realigned() for o in moved])
    estimates = found.shared_estimates()
    write_child(
        model_file,
        Fitted(
            with_estimates(richer, estimates),
            [e for e in estimates if e.seen],
            logs,
            before.score,
            after.score,
            noise_of(after),
            common_clock(found),
            bool(told),
            covariance=found.shared_covariance(),
        ),
        out,
        command,
    )
    return AddResult(name, before, after, estimates, *held, Path(out))
