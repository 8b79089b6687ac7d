# SPDX-License-Identifier: Apache-2.0
"""The model with what it lacked: base and effects at their posterior, in a file of its own.

Written is the likeliest set of missing effects, with what the base's own log shows beside it. An
effect that is of a moment of the log stays out, since no other log has it. An unnamed cause stays
out, too, but the base's numbers are those beside it, so that they do not stand for it.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
import twinmill_native as native

from twinmill.fitting.compare import Comparison, comparison
from twinmill.fitting.opening import open_measurements
from twinmill.inference.always import always_of
from twinmill.inference.duties import TABLE
from twinmill.inference.infer import Inference
from twinmill.inference.kept import as_table
from twinmill.inference.table import Numbers
from twinmill.model.child_file import Fitted, child_of
from twinmill.model.covariance import Covariance
from twinmill.model.model_file import ModelError, ModelFile
from twinmill.model.parameters import (
    CLOCK,
    CLOCK_RATE,
    ParameterEstimate,
    catalogue_name,
    effect_names,
    instance_of,
    key_of,
    newest_instance,
    with_role,
)


@dataclass(frozen=True)
class Better:
    """A model file with what was found, not written yet.

    Attributes:
        file: of it, with what it still misses in these logs as [fit.always].
        added: instances of effects that the given model does not have.
        before, after: comparison of the two models with the logs.
    """

    file: ModelFile
    added: tuple[str, ...]
    before: Comparison
    after: Comparison

    def to_json(self) -> dict[str, Any]:
        """Fields of `twinmill lab infer --output --json`."""
        return {
            "model": str(self.file.path),
            "added": list(self.added),
            "score": self.before.score,
            "score_after": self.after.score,
        }


def better(found: Inference, model_file: ModelFile, path: Path, command: str) -> Better:
    """The likeliest model, to be written.

    Args:
        found: in logs of one robot.
        model_file: the model that was judged.
        path: of the new file.
        command: recorded in it.

    Raises:
        ModelError: the file gives this robot numbers of its own.
    """
    robot = f"R{found.measurements[0].track.robot_id:02d}"
    if robot in tomlkit.parse(model_file.text).get("robots", {}):
        raise ModelError(
            f"{model_file.path}: [robots.{robot}] has numbers of this robot alone, and a better "
            f"model is written for all; take that table out of a copy, and give the copy."
        )
    before = comparison(model_file, open_measurements(found.measurements, model_file))
    fitted, added = _fitted(found, model_file, before.score)
    child = child_of(model_file, fitted, path, command)
    after = comparison(child, open_measurements(found.measurements, child))
    child = child_of(model_file, replace(fitted, score_after=after.score), path, command)
    document = tomlkit.parse(child.text)
    document["fit"]["always"] = as_table(always_of(found.measurements, child))
    return Better(ModelFile.of(path, tomlkit.dumps(document)), added, before, after)


def _fitted(
    found: Inference, model_file: ModelFile, score: float
) -> tuple[Fitted, tuple[str, ...]]:
    """Fit to be written, and its new instances of effects; the score is not known yet."""
    model, name_of = _with_effects(model_file, found)
    duties = model_file.model.drive == "duty"
    estimates, covariance = _told(found.answer.numbers, name_of, model, duties=duties)
    kept = [e for e in estimates if instance_of(e.name) != "clock"]
    for estimate in kept:
        model.set(estimate.name, estimate.value)
    clock = {e.name: e for e in estimates if e.name in (CLOCK, CLOCK_RATE)}
    declared = model.clock_same or any(m.same_clock for m in found.measurements)
    if declared or len(found.measurements) > 1:  # several logs may have an offset each
        clock = {}
    fitted = Fitted(
        model=model,
        estimates=kept,
        logs={m.log_name: m.log_sha256 for m in found.measurements},
        score_before=score,
        score_after=score,
        clock=clock,
        covariance=covariance.of([*(e.name for e in kept), *clock]),
    )
    return fitted, tuple(name_of.values())


def _with_effects(model_file: ModelFile, found: Inference) -> tuple[native.Model, dict[str, str]]:
    """The file's model with the effects, and the name there of each instance that was added."""
    own = found.answer.numbers.model
    model, name_of = model_file.model.copy(), {}
    always = found.always.effects if found.always else ()
    for instance in effect_names(own)[len(effect_names(model)) :]:
        kind = catalogue_name(instance)
        if kind not in (*always, *found.answer.added) or with_role(kind, "moment"):
            continue
        model.add_effect(kind)
        name_of[instance] = newest_instance(model, kind)
        for entry in own.values():
            if instance_of(entry["name"]) == instance:
                model.set(f"{name_of[instance]}.{key_of(entry['name'])}", entry["value"])
    return model, name_of


def _told(
    numbers: Numbers, name_of: dict[str, str], model: native.Model, *, duties: bool
) -> tuple[list[ParameterEstimate], Covariance]:
    """Estimates of the file's own quantities: of a refined table's nodes every second is one."""
    entries = {v["name"]: v for v in model.values()}
    at, names = [], []
    for k, label in enumerate(numbers.labels):
        name = label
        if instance_of(label) in name_of:
            name = f"{name_of[instance_of(label)]}.{key_of(label)}"
        elif duties and label.startswith(TABLE):
            node = int(label.removeprefix(TABLE))
            name = f"{TABLE}{node // 2}" if node % 2 == 0 else ""
        if name in entries:
            at.append(k)
            names.append(name)
    mean, cov = numbers.alone @ numbers.mean, numbers.alone @ numbers.cov @ numbers.alone.T
    cov = cov[np.ix_(at, at)]
    estimates = []
    for name, value, std in zip(names, mean[at], np.sqrt(np.diag(cov)), strict=True):
        low, high = entries[name]["min"], entries[name]["max"]
        value = np.clip(value, low, high)
        estimates.append(
            ParameterEstimate(
                name=name,
                value=float(value),
                std=float(std),
                unit=entries[name]["unit"],
                at_bound=not low < value < high,
                seen=True,
            )
        )
    return estimates, Covariance(tuple(names), cov)
