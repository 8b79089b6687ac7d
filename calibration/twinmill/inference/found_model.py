# SPDX-License-Identifier: Apache-2.0
"""A robot's model with the numbers of one hypothesis: its base, and effects that are let in."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import twinmill_native as native
from scipy.linalg import block_diag

from twinmill.inference.curve import straight
from twinmill.inference.duties import TABLE
from twinmill.inference.formula import Formula
from twinmill.inference.table import Numbers
from twinmill.model.covariance import Covariance
from twinmill.model.parameters import (
    ParameterEstimate,
    catalogue_name,
    duty_table,
    effect_names,
    instance_of,
    key_of,
    newest_instance,
)


@dataclass(frozen=True)
class FoundModel:
    """Model and estimates of one hypothesis.

    Attributes:
        model: with base and effects at their estimates.
        added: instances of effects that the given model does not have.
        estimates: of the given model's quantities and of these effects.
        covariance: of all of them.
    """

    model: native.Model
    added: tuple[str, ...]
    estimates: list[ParameterEstimate]
    covariance: Covariance


def found_model(given: native.Model, numbers: Numbers, let_in: Collection[str]) -> FoundModel:
    """Estimates of a model's own quantities: of a refined table all, or every second node is one.

    In the second case the others lie on straight lines between these.

    Args:
        given: the robot's model, whose table is refined or not; it stays as it is.
        numbers: of a hypothesis.
        let_in: kinds of effects that the model gets; others of the hypothesis stay out.
    """
    table = sum(label.startswith(TABLE) for label in numbers.labels)
    apart = table // max(len(duty_table(given)), 1)
    if apart > 1:
        numbers = straight(numbers)
    model, name_of = _with_effects(given, numbers, let_in)
    entries = {v["name"]: v for v in model.values()}
    names_at = [
        (k, name)
        for k, label in enumerate(numbers.labels)
        if (name := _name(label, name_of, apart)) in entries
    ]
    at, names = [k for k, _ in names_at], tuple(name for _, name in names_at)
    mean, cov = numbers.alone @ numbers.mean, numbers.alone @ numbers.cov @ numbers.alone.T
    cov = cov[np.ix_(at, at)]
    estimates = []
    for name, value, std in zip(names, mean[at], np.sqrt(np.diag(cov)), strict=True):
        low, high = entries[name]["min"], entries[name]["max"]
        value = float(np.clip(value, low, high))
        estimates.append(
            ParameterEstimate(
                name=name,
                value=value,
                std=float(std),
                unit=entries[name]["unit"],
                at_bound=not low < value < high,
                seen=True,
            )
        )
        if instance_of(name) != "clock":  # each log has its own
            model.set(name, value)
    return FoundModel(model, tuple(name_of.values()), estimates, Covariance(names, cov))


def with_formula(found: FoundModel, formula: Formula) -> FoundModel:
    """The model with a formula more, at its posterior beside all others."""
    model = found.model.copy()
    model.add_effect("equation", formula.texts)
    instance = newest_instance(model, "equation")
    names = tuple(f"{instance}.p{k}" for k in range(len(formula.values)))
    estimates = [
        ParameterEstimate(name=name, value=value, std=std, unit=unit, at_bound=False, seen=True)
        for name, value, std, unit in zip(
            names, formula.values, formula.stds, formula.units, strict=True
        )
    ]
    for estimate in estimates:
        model.set(estimate.name, estimate.value)
    values = block_diag(found.covariance.values, np.diag(np.square(formula.stds)))
    covariance = Covariance((*found.covariance.names, *names), values)
    return FoundModel(model, (*found.added, instance), [*found.estimates, *estimates], covariance)


def _with_effects(
    given: native.Model, numbers: Numbers, let_in: Collection[str]
) -> tuple[native.Model, dict[str, str]]:
    """The model with the effects, and the name there of each instance that was added."""
    own, model, name_of = numbers.model, given.copy(), {}
    for instance in effect_names(own)[len(effect_names(given)) :]:
        kind = catalogue_name(instance)
        if kind not in let_in:
            continue
        model.add_effect(kind)
        name_of[instance] = newest_instance(model, kind)
        for entry in own.values():
            if instance_of(entry["name"]) == instance:
                model.set(f"{name_of[instance]}.{key_of(entry['name'])}", entry["value"])
    return model, name_of


def _name(label: str, name_of: dict[str, str], apart: int) -> str:
    """Name in the given model of what a hypothesis calls so; empty if it has none.

    Args:
        label: in the hypothesis.
        name_of: instances of effects there and here.
        apart: nodes of the hypothesis's table from one of the model's to the next; 0 without one.
    """
    if instance_of(label) in name_of:
        return f"{name_of[instance_of(label)]}.{key_of(label)}"
    if apart and label.startswith(TABLE):
        node = int(label.removeprefix(TABLE))
        return "" if node % apart else f"{TABLE}{node // apart}"
    return label
