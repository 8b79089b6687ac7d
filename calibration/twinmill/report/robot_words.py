# SPDX-License-Identifier: Apache-2.0
"""In what one robot differs from the others of its kind, in plain words."""

import numpy as np

from twinmill.diagnosis.fleet import REFIT, Differs
from twinmill.model.parameters import BASE_GAINS, LAG, catalogue, catalogue_name, key_of
from twinmill.report.inference import give_or_take

WHEELS = "wheel_gain"
GROUPS = {  # of four wheels, those that may be weaker than the others, and what these are called
    ("fl", "rl"): ("left wheels", "the right ones"),
    ("fr", "rr"): ("right wheels", "the left ones"),
    ("fl", "fr"): ("front wheels", "the rear ones"),
    ("rl", "rr"): ("rear wheels", "the front ones"),
    ("fl",): ("front left wheel", "the others"),
    ("fr",): ("front right wheel", "the others"),
    ("rl",): ("rear left wheel", "the others"),
    ("rr",): ("rear right wheel", "the others"),
}
BY_AXIS = {
    BASE_GAINS[0]: ("drives {} faster ahead", "drives {} slower ahead"),
    BASE_GAINS[1]: ("drives {} faster sideways", "drives {} slower sideways"),
    BASE_GAINS[2]: ("turns {} more", "turns {} less"),
    LAG: ("has a motor lag {} longer", "has a motor lag {} shorter"),
}


def robot_sentence(one: Differs, percent: str) -> str:
    """A sentence on a robot that differs.

    Args:
        one: the robot, and in what.
        percent: the probability, in words.
    """
    others = "".join(f", or {name}" for name in one.others_of_group)
    return f"R{one.robot_id:02d}: {in_words(one)}{others} ({percent})."


def in_words(one: Differs) -> str:
    """In what it differs, without its number."""
    if one.name == REFIT:
        return f"{' and '.join(_axis(*row) for row in one.numbers.items())} than the model"
    if not one.is_effect:
        return f"lacks something that depends on {one.name}"
    if words := _wheels(one):
        return words
    numbers = ", ".join(
        f"{name} {give_or_take(value, std)}" for name, (value, std) in one.numbers.items()
    )
    told = next(filter(None, map(_card_words, one.numbers.items())), one.name)
    return f"{told} ({numbers})" if numbers else f"{one.name}"


def _axis(name: str, number: tuple[float, float]) -> str:
    more = number[0] - 1
    return BY_AXIS[name][more < 0].format(f"{100 * abs(more):.0f} %")


def _card_words(number: tuple[str, tuple[float, float]]) -> str:
    """Words of a parameter's card on a value above or below neutral."""
    name, (value, _) = number
    card = catalogue()[catalogue_name(name)]
    for own in card["parameters"]:
        if own["name"] == key_of(name):
            return str(own.get("above" if value > own["neutral"] else "below") or "")
    return ""


def _wheels(one: Differs) -> str:
    """Wheels that are weaker than the others: the group that leaves least of the differences."""
    gains = {key_of(name): value for name, (value, _) in one.numbers.items()}
    if one.name != WHEELS or set(gains) != {"fl", "fr", "rl", "rr"}:
        return ""
    group = min(GROUPS, key=lambda own: _group(gains, own))
    apart = _group(gains, group)[1]
    name, others = GROUPS[group]
    return f"{name} {100 * abs(apart):.0f} % {'weaker' if apart < 0 else 'stronger'} than {others}"


def _group(gains: dict[str, float], own: tuple[str, ...]) -> tuple[float, float]:
    """Squares that a group leaves which differs from the others, and by how much it does."""
    within = np.array([gain for wheel, gain in gains.items() if wheel in own])
    others = np.array([gain for wheel, gain in gains.items() if wheel not in own])
    left = within.var() * len(within) + others.var() * len(others)
    return round(float(left), 12), float(within.mean() - others.mean())
