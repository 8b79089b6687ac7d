# SPDX-License-Identifier: Apache-2.0
"""Known physics that a formula resembles by its shape and sign; empty if it resembles none."""

import re
from collections.abc import Callable, Mapping, Sequence
from math import pi
from types import MappingProxyType

import numpy as np

from twinmill.diagnosis.recurring import comes_again
from twinmill.formulas.forms import ROOM, STARTS, Form
from twinmill.formulas.term import WAY

AXES = {"vx": "driving", "vy": "driving sideways", "omega": "turning"}
CHANNEL_OF = {"vx_mps": "vx", "vy_mps": "vy", "omega_radps": "omega"}


def resembles(
    forms: Sequence[Form],
    numbers: Sequence[float],
    seen: Mapping[str, tuple[float, float]] = MappingProxyType({}),
) -> str:
    """In words, of the first term that says something; empty if none does.

    Args:
        forms: terms of a formula.
        numbers: theirs, in order.
        seen: least and most of names of the motion in the logs, where known.
    """
    first = 0
    for form in forms:
        own = numbers[first : first + len(form.shapes)]
        first += len(form.shapes)
        if slow := _of_few_periods(form, seen):
            return slow
        for looks in LOOKS:
            if words := looks(form, own):
                return words
    return ""


def _of_speed(form: Form, own: Sequence[float]) -> str:
    axis = CHANNEL_OF.get(form.adds_to)
    opposing = own[0] < 0
    if axis and form.shapes == (f"{axis}*abs({axis})",):
        return (
            f"quadratic in the speed of {AXES[axis]}, opposing motion: like air drag or oil in the "
            "gear"
            if opposing
            else f"quadratic in the speed of {AXES[axis]}, with the motion: like motors that gain "
            "more than in proportion"
        )
    if axis and form.shapes == (f"sign({axis})",) and opposing:
        return f"constant against {AXES[axis]}: like dry friction"
    if axis and form.shapes == (f"abs({axis})",):
        return f"another size of {AXES[axis]} one way than the other: like unequal motors or a gear"
    if axis and form.shapes[0].startswith(f"sign({axis})*max(0") and opposing:
        return f"a loss of {AXES[axis]} from some speed on: like slip or a voltage that gives out"
    if form.adds_to == "travel" and form.shapes == ("(vx*vx + vy*vy)",) and opposing:
        return "a loss of way with the square of the speed: like air drag"
    if form.adds_to == "travel" and form.shapes == ("sqrt(vx*vx + vy*vy)",) and opposing:
        return "a loss of way in proportion to the speed: like slip of the wheels"
    if form.adds_to == "travel" and "omega" in form.shapes[0] and opposing:
        return "a loss of way where it turns: like tyres that scrub in curves"
    return ""


def _around_a_speed(form: Form, own: Sequence[float]) -> str:
    if form.unit not in ("m/s", "rad/s"):
        return ""
    what = "less" if own[0] < 0 else "more"
    return f"{what} around {form.constant:.3g} {form.unit} alone: like a resonance or a controller"


def _of_two_speeds(form: Form, own: Sequence[float]) -> str:
    axis = CHANNEL_OF.get(form.adds_to)
    named = set(re.findall(r"vx|vy|omega", form.shapes[0]))
    if form.adds_to in ("vx_mps", "vy_mps") and "omega" in named and named - {"omega", axis}:
        return "grows with the pull of curves: like wheels that slip sideways"
    if form.adds_to == "omega_radps" and named and axis not in named:
        return "turning that comes of driving: like a smaller wheel or a load off the middle"
    return ""


def _of_past(form: Form, own: Sequence[float]) -> str:
    if not form.state:
        return ""
    if form.state.swings:
        swings = f"{form.constant / (2 * pi):.3g} Hz, damping {form.damping:.2g}"
        if form.adds_to == ROOM:
            return (
                f"the robot or its marker sways after each change of speed, as on a mast: {swings}"
            )
        what = AXES[CHANNEL_OF[form.adds_to]] if form.of_body else "all wheels"
        return f"an overshoot of the speed loop or a spring ({what}): {swings}"
    if form.group == WAY:
        changes = "lost" if own[0] < 0 else "gained"
        return f"speed is {changes} with the way driven: like tyres that wear, clog or warm up"
    if form.group == STARTS:
        way = "less" if own[0] < 0 else "more"
        return (
            f"it moves {way} for {form.constant:.3g} s after a start: like grease that sets, or "
            "tyres that grip after a rest"
        )
    if not form.of_body:
        first = "go beyond their speed first" if own[0] > 0 else "creep to their speed"
        return f"all wheels {first}, over {form.constant:.3g} s: like a soft gear or a controller"
    if form.adds_to == "motion":
        falls = "falls" if own[0] < 0 else "rises"
        of = "heat of the motors" if form.state.goal.startswith("(") else "load of the battery"
        return f"speed {falls} with a memory of {form.constant:.3g} s of how hard it drove: {of}"
    axis = CHANNEL_OF[form.adds_to]
    if form.shapes == (f"s*{axis}",):
        falls = "falls" if own[0] < 0 else "rises"
        return (
            f"{AXES[axis]} {falls} with a memory of {form.constant:.3g} s of how hard it was done: "
            "heat of a gear or of motors"
        )
    reach = f"{form.constant:.3g} {form.unit}"
    if "abs" not in form.state.rate:
        return f"{AXES[axis]} follows later, within {reach}: like a second lag, or a soft mount"
    if form.shapes == ("s",):
        return f"friction that builds up over {reach} after a reversal: like bristles (Dahl 1968)"
    return f"way of {AXES[axis]} is stored over {reach} after a reversal: like play or soft tyres"


def _of_few_periods(form: Form, seen: Mapping[str, tuple[float, float]]) -> str:
    """Waves with too few periods in the logs to be called periodic."""
    name, rate = form.wave
    if name not in seen or comes_again(rate, np.ptp(seen[name])):
        return ""
    if name == "t":
        return "changes slowly over the run: like a battery, heat or a load that shifts"
    return f"changes along {name}: like a floor that is not the same everywhere"


def _of_place_or_time(form: Form, own: Sequence[float]) -> str:
    name, rate = form.wave
    if form.group == "place" and name:
        return f"comes again every {2 * pi / rate:.2f} m along {name}: like tiles, planks or seams"
    if form.adds_to == "theta_rad":
        return "the captured heading is off by the heading: like a compass or a tag seen aslant"
    if form.adds_to == "omega_radps" and form.group == "heading":
        return "turns more toward one heading: like a slope, or a compass that is pulled"
    if form.adds_to == ROOM:
        return "pushed to one side of the room, the more the faster it drives: like wind or pile"
    if form.adds_to == "travel" and form.shapes[0] == "cos(course)":
        return "more in one direction of the room, less in the other: like wind, pile or a slope"
    if form.adds_to == "aside":
        return "led aside by the direction in which it drives: like grooves, joints or pile"
    if name == "t" and form.recurs:
        return f"comes and goes every {2 * pi / rate:.3g} s: like a load that is switched"
    if name == "t":
        every_s = 2 * pi / rate
        return f"swings every {every_s:.3g} s: like a regulator that hunts, or a part that turns"
    if form.group == "time" and "<" in form.shapes[0]:
        return "there for a while: like something that was held, hung on or carried"
    if form.group == "time" and ">" in form.shapes[0]:
        return "from a moment on: like something that came loose or broke"
    return ""


LOOKS: tuple[Callable[[Form, Sequence[float]], str], ...] = (
    _around_a_speed,
    _of_speed,
    _of_two_speeds,
    _of_past,
    _of_place_or_time,
)
