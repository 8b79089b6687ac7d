# SPDX-License-Identifier: Apache-2.0
"""Changes of a model that show if a part of it matters for the swarm."""

import difflib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.arguments import option
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    NO_SIZE,
    NORMAL_95,
    card_of,
    catalogue_name,
    catalogue_of,
    effect_names,
)
from twinmill.model.ranges import Quantity, ranges
from twinmill.swarm.matters.hidden import Hidden
from twinmill.swarm.model_text import for_all_robots, with_effect, with_robot, with_values

PLANT = "planar"
SPREADS = (
    "idiosyncrasy.theta_a1_std",
    "idiosyncrasy.theta_a2_std",
    "sensor.range_std_m",
    "sensor.cone_std_rad",
)
USUAL_SPREAD = 0.04  # of gains over robots, where the model states none
LEFT = ("fl", "rl")  # of effects that each wheel has of its own, the left wheels are tried


@dataclass(frozen=True)
class Change:
    """One way in which the model could be otherwise.

    Attributes:
        what: in words, to stand behind "with".
        text: the changed model file.
        values: what was set, by name.
    """

    what: str
    text: str
    values: dict[str, float]


@dataclass(frozen=True)
class Factor:
    """Part that is asked about, with all changes that answer.

    Attributes:
        name: an effect, a quantity, `robots` (their differences) or `together` (all quantities).
        kind: `effect` of the model, `parameter`, `hidden` (an effect that the log does not exclude,
            at most as large as it may be), `one_robot`, `robots` or `together`.
        about: what its changes have in common, in words.
    """

    name: str
    kind: str
    about: str
    changes: list[Change]


def factors(
    file: ModelFile,
    hidden: Sequence[Hidden],
    *,
    drawn: int,
    seed: int,
    only: Collection[str] = (),
) -> tuple[list[Factor], list[tuple[str, str]]]:
    """All that is asked about a model.

    Args:
        file: the model.
        hidden: effects that the log does not exclude.
        drawn: models drawn from the uncertainty of all quantities.
        seed: of them.
        only: names to which it is confined; none: all.

    Returns:
        Subjects, and what is left out with the reason.

    Raises:
        ValueError: there is nothing of one of the names; names the nearest.
    """
    found = [*_effects(file), *_parameters(file), *_robots(file), *_together(file, drawn, seed)]
    for one in hidden:
        found += _hidden(file, one)
    names = {factor.name for factor in found}
    for name in only:
        if name not in names:
            near = difflib.get_close_matches(name, sorted(names), n=1, cutoff=0)
            raise ValueError(
                f"{option('only', name)}: is no effect, and no number of the model that has an "
                "interval; "
                f"the nearest is '{near[0]}'."
            )
    return _acting([s for s in found if not only or s.name in only])


def neutral(model: native.Model, instance: str) -> dict[str, float]:
    """Values at which an effect of the model does nothing, by parameter."""
    parameters = card_of(model, instance)["parameters"]
    return {p["name"]: p["neutral"] for p in parameters if p["role"] not in NO_SIZE}


def _effects(file: ModelFile) -> list[Factor]:
    found = []
    for instance in effect_names(file.model):
        if catalogue_of(file.model)[catalogue_name(instance)]["stage"] == "observe":
            continue
        off = neutral(file.model, instance)
        named = _named(instance, off)
        text = with_values(for_all_robots(file.text, instance), file.model, named)
        own = with_robot(file.text, 0, instance, off)
        found += [
            Factor(instance, "effect", "of the model", [Change("it left out", text, named)]),
            Factor(
                instance,
                "one_robot",
                "one robot without it",
                [Change("one robot without it", own, {f"R00.{k}": v for k, v in named.items()})],
            ),
        ]
    return found


def _parameters(file: ModelFile) -> list[Factor]:
    """Each quantity at both ends of its 95 % interval; what goes together with it goes along."""
    try:
        known = ranges(file, file.model, 1, 0)
    except ValueError:
        return []
    found = []
    for i, q in enumerate(known.quantities):
        if q.source == "robots":
            continue
        changes = []
        for end in q.interval:
            along = known.covariance[i] / known.covariance[i, i] * (end - q.value)
            values = _moved(known.quantities, along)
            text = with_values(file.text, file.model, values)
            changes.append(Change(f"{q.name} = {_short(end)}{_unit(q.unit)}", text, values))
        low, high = map(_short, q.interval)
        about = f"within its interval {low} to {high}{_unit(q.unit)}"
        found.append(Factor(q.name, "parameter", about, changes))
    return found


def _moved(known: Sequence[Quantity], along: np.ndarray) -> dict[str, float]:
    return {
        q.name: float(np.clip(q.value + step, q.min, q.max))
        for q, step in zip(known, along, strict=True)
        if step != 0 and q.source != "robots"
    }


def _together(file: ModelFile, drawn: int, seed: int) -> list[Factor]:
    """All quantities drawn at once from what the fits leave open."""
    try:
        known = ranges(file, file.model, drawn, seed)
    except ValueError:
        return []
    names = [(i, q.name) for i, q in enumerate(known.quantities) if q.source != "robots"]
    changes = []
    for k, sample in enumerate(known.samples, 1):
        values = {name: float(sample[i]) for i, name in names}
        changes.append(Change(f"draw {k}", with_values(file.text, file.model, values), values))
    about = f"{len(names)} numbers drawn from what the fits leave open"
    return [Factor("together", "together", about, changes)] if names and drawn else []


def _robots(file: ModelFile) -> list[Factor]:
    """Robots all alike, and one that drives or turns otherwise."""
    stds = {name: file.model.get(name) for name in SPREADS}
    found = []
    if any(stds.values()):
        alike = dict.fromkeys(stds, 0.0)
        text = with_values(file.text, file.model, alike)
        found.append(
            Factor("robots", "robots", "differences of robots", [Change("all alike", text, alike)])
        )
    words = {"theta_a1": ("faster", "slower"), "theta_a2": ("quicker to turn", "slower to turn")}
    for gain, (more, less) in words.items():
        off = NORMAL_95 * (stds[f"idiosyncrasy.{gain}_std"] or USUAL_SPREAD)
        changes = [
            Change(
                f"one robot {100 * off:.0f} % {more if sign > 0 else less}",
                with_robot(file.text, 0, None, {gain: 1 + sign * off}),
                {f"R00.{gain}": 1 + sign * off},
            )
            for sign in (1, -1)
        ]
        found.append(Factor(gain, "one_robot", "one robot apart from the others", changes))
    return found


def _hidden(file: ModelFile, hidden: Hidden) -> list[Factor]:
    """An effect that the model lacks: of all robots as strong as it may be, of one as it is usual.

    The log tells of the robot that was recorded; another may have what that one has not.
    """
    card = catalogue_of(file.model)[hidden.effect]
    for_all, one = [], []
    bare = with_effect(file.text, hidden.effect, _at(card, 0.0))
    for sign in (1.0, -1.0):
        most, usual = _at(card, sign * hidden.times), _at(card, sign)
        if _acts(card, most):
            text = with_effect(file.text, hidden.effect, most)
            for_all.append(Change(_words(card, most), text, _named(hidden.effect, most)))
        if _acts(card, usual):
            text = with_robot(bare, 0, hidden.effect, usual)
            values = {f"R00.{k}": v for k, v in _named(hidden.effect, usual).items()}
            one.append(Change(f"one robot with {_words(card, usual)}", text, values))
    return [
        Factor(hidden.effect, "hidden", hidden.why, for_all),
        Factor(hidden.effect, "one_robot", "one robot with it, as strong as is usual", one),
    ]


def _at(card: Mapping[str, Any], times: float) -> dict[str, float]:
    """Parameters at so many times the usual strength; the other way if negative."""
    left = [p["name"] for p in card["parameters"] if p["name"].partition("_")[0] in LEFT]
    moved = left or [p["name"] for p in card["parameters"]]
    values = {}
    for p in card["parameters"]:
        if p["role"] in NO_SIZE:
            values[p["name"]] = p["default"]
            continue
        step = times * (p["default"] - p["neutral"]) if p["name"] in moved else 0.0
        values[p["name"]] = float(np.clip(p["neutral"] + step, p["min"], p["max"]))
    return values


def _acts(card: Mapping[str, Any], values: Mapping[str, float]) -> bool:
    strong = (p for p in card["parameters"] if p["role"] not in NO_SIZE)
    return any(values[p["name"]] != p["neutral"] for p in strong)


def _acting(found: Sequence[Factor]) -> tuple[list[Factor], list[tuple[str, str]]]:
    """Without what the plant cannot show; which, and why."""
    kept, left = [], {}
    for factor in found:
        why = ""
        for change in factor.changes:
            inert = dict(native.Model.from_toml(change.text, "changed").inert(PLANT))
            why = next((w for n, w in inert.items() if n.partition(".")[0] == factor.name), "")
        if why:
            left[factor.name] = f"{why} (it does not act in this plant)"
        elif factor.changes:
            kept.append(factor)
    return kept, list(left.items())


def _named(instance: str, values: Mapping[str, float]) -> dict[str, float]:
    return {f"{instance}.{key}": value for key, value in values.items()}


def _words(card: Mapping[str, Any], values: Mapping[str, float]) -> str:
    """`view_range (factor 0.8)`: what is not neutral, places left out."""
    told = [
        f"{p['name']} {_short(values[p['name']])}{_unit(p['unit'])}"
        for p in card["parameters"]
        if p["role"] not in NO_SIZE and values[p["name"]] != p["neutral"]
    ]
    return f"{card['name']} ({', '.join(told)})"


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def _short(value: float) -> str:
    return f"{value:.3g}"
