# SPDX-License-Identifier: Apache-2.0
"""Probabilities of what cameras lack, as sentences, tables and figures."""

from twinmill.inference.answer import Named
from twinmill.inference.cameras import Cameras
from twinmill.report import detections
from twinmill.report.html import Figure
from twinmill.report.tables import Table, number, of_unit, percent


def words(cameras: Cameras) -> list[str]:
    """Sentences on what all cameras lack, on those that differ, and on what to keep in mind."""
    told = [f"The cameras' detections lack {_name(f)}." for f in cameras.findings]
    if not told and cameras.nothing >= 0.5:
        told = [f"The cameras' detections lack nothing ({percent(cameras.nothing)})."]
    elif not told:
        first, p = next(iter(cameras.effects.items()))
        told = [
            f"The cameras' detections lack something or not ({percent(cameras.nothing)}); first of "
            f"all {first} ({percent(p)})."
        ]
    return [*told, *(off.sentence for off in cameras.off), *cameras.notes]


def tables(cameras: Cameras) -> list[Table]:
    """Scores by step, and counts of frames by what was predicted and reported."""
    steps = [detections.steps(cameras.steps)] if len(cameras.steps) > 1 else []
    return [*steps, *detections.confusion_tables(cameras.after or cameras.before)]


def figures(cameras: Cameras) -> list[Figure]:
    """Pictures of what cameras see, with the model as given and with what was found."""
    title = "What the camera sees, effects added"
    after = [detections.field_of_view(cameras.after, title)] if cameras.after else []
    return [detections.field_of_view(cameras.before), *after]


def _name(found: Named) -> str:
    if found.certainty == "group":
        return f"one of {', '.join(found.group)} ({percent(found.group_probability)})"
    units = {p["name"]: p["unit"] for p in found.to_json()["parameters"]}
    numbers = ", ".join(
        f"{name} {number(value)} ± {number(std, 2)} {of_unit(units[name])}".rstrip()
        for name, (value, std) in found.numbers.items()
    )
    word = "" if found.certainty == "sure" else ", not sure"
    return f"{found.effect} ({percent(found.probability)}{word}: {numbers})"
