# SPDX-License-Identifier: Apache-2.0
"""Model files written anew with what was fitted; the rest of the text stays as it is."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import tomlkit
import twinmill_native as native

from twinmill.model.covariance import Covariance
from twinmill.model.model_file import ModelFile, quantity_names
from twinmill.model.parameters import (
    ParameterEstimate,
    card_of,
    catalogue_name,
    catalogue_of,
    effect_names,
)


class NoiseTable(Protocol):
    """Noise of a log, as far as a model file records it."""

    @property
    def speed_mps(self) -> float:
        """RMS speed at which it was seen."""
        ...

    def to_json(self) -> dict[str, float]:
        """Keys and values of the table `[noise]`."""


@dataclass(frozen=True)
class Fitted:
    """Results of a fit, as a new model file records them.

    Attributes:
        model: with the fitted values and effects.
        estimates: with their uncertainties.
        logs: sha256 of the logs fitted on, by name.
        score_before, score_after: on those logs.
        noise: of the first log, or None to leave the old.
        clock: offset and rate that the logs share, by name; empty if they do not agree.
        base_told: the base was held near what other logs told; they keep the credit.
        left_over: what a diagnosis found that no effect explains; None if there was none.
        robots: what is a robot's own, by its number.
        covariance: of the estimates; None where the fit has none.
        shares: of the squared error that each new effect takes away, by its name in the model; a
            refit of the base has its own.
        duty_pct: nodes of the model's table, where these are not the parent's.
    """

    model: native.Model
    estimates: list[ParameterEstimate]
    logs: dict[str, str]
    score_before: float
    score_after: float
    noise: NoiseTable | None = None
    clock: dict[str, ParameterEstimate] = field(default_factory=dict)
    base_told: bool = False
    left_over: dict[str, float] | None = None
    robots: dict[int, list[ParameterEstimate]] = field(default_factory=dict)
    covariance: Covariance | None = None
    shares: Mapping[str, float] = field(default_factory=dict)
    duty_pct: tuple[float, ...] = ()


def child_of(parent: ModelFile, fitted: Fitted, path: Path, command: str) -> ModelFile:
    """The fitted model as its file has it, before that is written."""
    document = tomlkit.parse(parent.text)
    document["parent"] = parent.hash
    document["created_by"] = command
    before = parent.model
    if fitted.duty_pct:
        write_nodes(document, fitted.duty_pct)
        before = native.Model.from_toml(tomlkit.dumps(document), str(parent.path))
    _write_moved(document, before, fitted.model)
    _write_base(document, fitted)
    _write_effects(document, fitted)
    _write_robots(document, fitted)
    if fitted.noise:
        section = document.setdefault("noise", tomlkit.table())
        section.update({k: _short(v) for k, v in fitted.noise.to_json().items()})
    if fitted.clock:
        section = document.setdefault("clock", tomlkit.table())
        clock = {name.removeprefix("clock."): e for name, e in fitted.clock.items()}
        section.update({key: _short(e.value) for key, e in clock.items()})
        section["std"] = {key: _short(e.std) for key, e in clock.items()}
        section["fitted_on"] = list(fitted.logs.values())
    old = document.get("fit", {}).get("left_over", {})
    covariance = parent.covariance.of(quantity_names(fitted.model)).replaced_by(fitted.covariance)
    document["fit"] = {
        "logs": list(fitted.logs),
        "score_before": _short(fitted.score_before),
        "score_after": _short(fitted.score_after),
    }
    speed_mps = fitted.noise.speed_mps if fitted.noise else parent.noise_speed_mps
    if speed_mps:
        document["fit"]["noise_speed_mps"] = _short(speed_mps)
    if fitted.left_over is not None:
        left = {group: _short(value) for group, value in fitted.left_over.items()}
        old = {**left, "fitted_on": list(fitted.logs.values())} if left else {}
    if old:
        document["fit"]["left_over"] = old
    if covariance.names:
        document["fit"]["covariance"] = covariance.to_toml()
    return ModelFile.of(Path(path), tomlkit.dumps(document))


def _short(value: float) -> float:
    return float(f"{value:.6g}")


def write_nodes(document: tomlkit.TOMLDocument, duty_pct: Sequence[float]) -> None:
    """Other nodes of the duty table, in percent, on its straight lines; errors go."""
    base = document["base"]
    speeds = np.interp(duty_pct, base["duty_pct"].unwrap(), base["wheel_speed_mps"].unwrap())
    base["duty_pct"], base["wheel_speed_mps"] = list(duty_pct), speeds.tolist()
    base.get("std", {}).pop("wheel_speed_mps", None)


def _write_moved(document: tomlkit.TOMLDocument, before: native.Model, after: native.Model) -> None:
    """Values of the base that are not as before, those that a log hardly tells as well.

    The predictions that were scored had them.
    """
    base = document.setdefault("base", tomlkit.table())
    for entry in after.values():
        section, *key = entry["name"].split(".")
        if section != "base" or entry["value"] == before.get(entry["name"]):
            continue
        values, place = (base[key[0]], int(key[1])) if len(key) == 2 else (base, key[0])
        values[place] = _short(entry["value"])


def _write_base(document: tomlkit.TOMLDocument, fitted: Fitted) -> None:
    base = document.setdefault("base", tomlkit.table())
    stds: dict[str, Any] = {}
    for estimate in fitted.estimates:
        section, *key = estimate.name.split(".")
        if section != "base":
            continue
        values: Any = base
        errors: Any = stds
        place: str | int = key[0]
        if len(key) == 2:  # an entry of a table: those that were not fitted have no error
            values, place = base[key[0]], int(key[1])
            errors = stds.setdefault(key[0], [math.nan] * len(values))
        values[place], errors[place] = _short(estimate.value), _short(estimate.std)
    if stds and not fitted.base_told:
        base["std"] = stds
        base["fitted_on"] = list(fitted.logs.values())


def _write_robots(document: tomlkit.TOMLDocument, fitted: Fitted) -> None:
    """Writes parameters of single robots, as [robots.R03]."""
    for robot_id, estimates in sorted(fitted.robots.items()):
        robots = document.setdefault("robots", tomlkit.table(is_super_table=True))
        own = robots.setdefault(f"R{robot_id:02d}", tomlkit.table())
        for estimate in estimates:
            *effect, key = estimate.name.removeprefix("base.").split(".")
            place = own.setdefault(effect[0], tomlkit.inline_table()) if effect else own
            place[key] = _short(estimate.value)


def _own_bounds(model: native.Model, instance: str) -> dict[str, list[float]]:
    """Bounds of an effect's numbers that are narrower than the catalogue's, by their names."""
    usual = catalogue_of(model)[catalogue_name(instance)]["parameters"]
    pairs = zip(card_of(model, instance)["parameters"], usual, strict=False)
    keys = ("min", "max")
    return {p["name"]: [p[k] for k in keys] for p, u in pairs if any(p[k] != u[k] for k in keys)}


def _write_effects(document: tomlkit.TOMLDocument, fitted: Fitted) -> None:
    stds = {e.name: e.std for e in fitted.estimates}
    old = list(document.get("effect", []))
    tables = tomlkit.aot()
    instances = zip(effect_names(fitted.model), fitted.model.texts, strict=True)
    for i, (instance, texts) in enumerate(instances):
        table = tomlkit.table() if i >= len(old) else old[i]
        table["name"] = catalogue_name(instance)
        table.update({key: text for key, text in texts.items() if text})
        keys = [p["name"] for p in card_of(fitted.model, instance)["parameters"]]
        for key in keys:
            table[key] = _short(fitted.model.get(f"{instance}.{key}"))
        known = {
            key: _short(stds[f"{instance}.{key}"]) for key in keys if f"{instance}.{key}" in stds
        }
        if known:
            table["std"] = known
            table["fitted_on"] = ", ".join(fitted.logs)
        if i >= len(old):
            if bounds := _own_bounds(fitted.model, instance):
                table["bounds"] = bounds
            table["error_before"] = _short(fitted.score_before)
            table["error_after"] = _short(fitted.score_after)
            if instance in fitted.shares:
                table["share"] = _short(fitted.shares[instance])
        tables.append(table)
    if len(tables):
        document["effect"] = tables
