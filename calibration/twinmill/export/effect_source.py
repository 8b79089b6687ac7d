# SPDX-License-Identifier: Apache-2.0
"""Source, card and test of an effect for the catalogue, from the equation of a model."""

import json
import re
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap

import twinmill_native as native
from jinja2 import Environment, PackageLoader, StrictUndefined

from twinmill.arguments import option
from twinmill.diagnosis.fleet import REFIT
from twinmill.export.formula_cpp import in_cpp
from twinmill.fitting.add import OWN_GAINS
from twinmill.model.model_file import ModelError, ModelFile, write_whole
from twinmill.model.parameters import (
    FORMULA_NUMBERS,
    FORMULAS,
    RATES,
    card_of,
    catalogue,
    catalogue_name,
    effect_names,
    numbers_of,
    words,
)

CATALOGUE, TESTS = Path("twin/effects/catalogue"), Path("tests/effects")
LISTED = "add_executable(test_effects\n"  # in the tests' CMakeLists.txt; the new one follows
NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
FAR = 1e6  # of any number: its size is the formula's
LONGEST = 78  # of a text in the card
NEW = "new"  # in the place of an effect's name
NAME_IN_FORMULA = re.compile(r"[A-Za-z_]\w*")
RESERVED = {OWN_GAINS, REFIT, NEW}  # which commands take for something else

WHEEL = {
    "u": "in.duty[k]",
    "V": "in.battery_V",
    "left": "in.robot.left[k]",
    "front": "in.robot.front[k]",
    "t": "in.t_s",
}
RIM = {
    **WHEEL,
    "rim": "in.rim_mps[k]",
    "target": "in.target_mps[k]",
    "angle": "in.wheel_rad[k]",
}
BODY = {
    "vx": "in.vx_mps",
    "vy": "in.vy_mps",
    "omega": "in.omega_radps",
    "x": "in.x_m",
    "y": "in.y_m",
    "theta": "in.theta_rad",
    "course": "(in.theta_rad + std::atan2(in.vy_mps, in.vx_mps))",
    "moves": "(in.moves ? 1.0 : 0.0)",
    "t": "in.t_s",
}
POSE = {"x": "in.x_m", "y": "in.y_m", "theta": "in.theta_rad"}
CHANGING = {"x", "y", "theta", "course", "t", "rim", "angle"}  # within a step, which holds them


@dataclass(frozen=True)
class Place:
    """Where an equation acts: type of the signals, names in them, what is done with its value."""

    stage: str
    signals: str
    act: str
    names: dict[str, str]
    acts: tuple[str, ...] = ()
    wheels: str = ""


def _on_body(*acts: str) -> Place:
    return Place("ground", "GroundSignals", "OnGround{Step}", BODY, acts)


SHARES = ("travel", "motion", "aside")  # of the way or of all motion
PLACES = {
    "duty": Place(
        "duty", "DutySignals", "OnDuty{Step}", WHEEL, ("in.duty[k] += {};",), "kMaxWheels"
    ),
    "rim_mps": Place(
        "wheel",
        "WheelSignals",
        "OnWheels{Step}",
        RIM,
        ("in.target_mps[k] += {};",),
        "in.robot.wheels",
    ),
    "vx_mps": _on_body("in.vx_mps += {};"),
    "vy_mps": _on_body("in.vy_mps += {};"),
    "omega_radps": _on_body("in.omega_radps += {};"),
    "travel": _on_body(
        "const double share = 1 + {};", "in.vx_mps *= share;", "in.vy_mps *= share;"
    ),
    "motion": _on_body(
        "const double share = 1 + {};",
        "in.vx_mps *= share;",
        "in.vy_mps *= share;",
        "in.omega_radps *= share;",
    ),
    "aside": _on_body(
        "const double share = {};",
        "const double vx_mps = in.vx_mps;",
        "in.vx_mps -= share * in.vy_mps;",
        "in.vy_mps += share * vx_mps;",
    ),
    "theta_rad": Place("observe", "ObservedPose", "OnObservation{Observe, Invert}", POSE),
}


@dataclass(frozen=True)
class Own:
    """A number of the equation as the model has it: its name, unit and value."""

    name: str
    unit: str
    value: float


@dataclass(frozen=True)
class Function:
    """A C++ function of one text: its arguments, what is passed, the numbers that it names."""

    text: str
    arguments: str
    values: str
    parameters: Sequence[str]


def write_effect(name: str, model_file: ModelFile, instance: str | None, root: Path) -> list[Path]:
    """Writes the source and the test of an effect, and lists the test for the build.

    Args:
        name: of the new effect.
        model_file: that has the equation.
        instance: of the equation in it: `equation`, `equation#2`; None: the only one.
        root: of the project's source.

    Returns:
        The files written.

    Raises:
        ValueError: the name is no name or is taken, or the formula cannot be said in C++.
        ModelError: the model has no such equation, or `root` is not the project's source.
    """
    source, test = root / CATALOGUE / f"{name}.cpp", root / TESTS / f"test_{name}.cpp"
    lists = root / TESTS / "CMakeLists.txt"
    model = model_file.model
    _check(name, model, root, (source, test))
    listed = lists.read_text()
    if LISTED not in listed:
        raise ModelError(f"{lists}: has no line '{LISTED.strip()}'; list the test there by hand.")
    instance = _chosen(model_file, instance)
    told = model.texts[effect_names(model).index(instance)]
    texts = _texts(told, instance)
    cards = card_of(model, instance)["parameters"]
    own = {
        p: Own(card["name"], card["unit"], model.get(f"{instance}.{card['name']}"))
        for p, card in zip(FORMULA_NUMBERS, cards, strict=False)
    }
    made = _source(name, texts, own, told=told, model=model_file.path.name)
    tested = _test(name, texts, own)
    with ExitStack() as undo:  # of all or none
        for path, text in ((source, made), (test, tested)):
            undo.callback(path.unlink, missing_ok=True)
            write_whole(path, text)
        write_whole(lists, listed.replace(LISTED, f"{LISTED}    test_{name}.cpp\n", 1))
        undo.pop_all()
    return [source, test, lists]


def _chosen(model_file: ModelFile, instance: str | None) -> str:
    """Equation of a model that is asked for by name, or the only one."""
    has = [n for n in effect_names(model_file.model) if catalogue_name(n) == "equation"]
    if not has:
        raise ModelError(f"{model_file.path.name}: has no equation; `add equation` takes one in.")
    if instance is None and len(has) > 1:
        raise ModelError(
            f"{model_file.path.name}: has several equations; say which by {option('equation')}: "
            f"{', '.join(has)}."
        )
    if instance is not None and instance not in has:
        raise ModelError(
            f"{model_file.path.name}: has no '{instance}'; its equations are {', '.join(has)}."
        )
    return instance or has[0]


def _texts(told: dict[str, str], instance: str) -> dict[str, str]:
    """Formulas of an equation that can be an effect, its numbers as p0 to p3.

    In the source they cannot mean something else, as a number that is called `value` would.
    """
    texts = {"adds_to": told["adds_to"]}
    places = dict(zip(numbers_of(told), FORMULA_NUMBERS, strict=False))
    for key in FORMULAS:
        texts[key] = NAME_IN_FORMULA.sub(lambda m: places.get(m[0], m[0]), told[key])
    if texts["adds_to"] not in PLACES:
        raise ValueError(
            f"{instance}: adds to {texts['adds_to']}, which has two values, and only formulas of "
            "one value are written as an effect; keep the equation in the model."
        )
    if not _numbers(texts):
        raise ValueError(
            f"{instance}: '{texts['formula']}' has none of p0 to p3, so that nothing would switch "
            "the effect off; write a number of it as p0."
        )
    return texts


def _check(name: str, model: native.Model, root: Path, files: Sequence[Path]) -> None:
    if not NAME.fullmatch(name):
        raise ValueError(
            f"effect '{name}': is no name; use small letters, figures and single underscores."
        )
    if name in RESERVED:
        raise ValueError(f"effect '{name}': commands mean something else by it; take another name.")
    if name in catalogue():
        raise ValueError(f"effect '{name}': the catalogue has it already; take another name.")
    if name in {part for row in model.values() for part in row["name"].split(".")}:
        raise ValueError(
            f"effect '{name}': model files mean something else by it; take another name."
        )
    needed = (CATALOGUE, TESTS / "CMakeLists.txt")
    if missing := next((place for place in needed if not (root / place).exists()), None):
        raise ModelError(
            f"{root}: holds no {missing}, so it is not the project's source; run this there, or "
            f"name it with {option('into')}."
        )
    if there := next((f for f in files if f.exists()), None):
        raise ValueError(f"{there}: exists already; take another name, or remove it.")


def _source(
    name: str, texts: dict[str, str], own: dict[str, Own], *, told: dict[str, str], model: str
) -> str:
    place = PLACES[texts["adds_to"]]
    rates = {of: texts[key] for key, of in RATES.items() if texts.get(key)}
    used = words(" ".join([texts["formula"], *rates.values()]))
    state = {of: of for of in rates}
    formula = _function(texts["formula"], place.names, state)
    what = "adds" if texts["adds_to"] not in SHARES else "changes by a share"
    equation = f"{what} to {texts['adds_to']}: {told['formula']}"
    for key, of in RATES.items():
        equation += f"; d{of}/dt = {told[key]}, {of} = 0 at the start" if of in rates else ""
    return (
        _environment()
        .get_template("effect.cpp.j2")
        .render(
            name=name,
            summary="Taken from an equation that was found for what a model lacked.",
            equation="\n".join(f"        {_quoted(line)}" for line in _wrapped(equation)),
            measure="drives that vary the quantities in the equation; what it resembles is its own",
            reference=_quoted(f"found in data by twinmill diagnose; {model}"),
            phrase="a formula that was found in data",
            **_kind(used, bool(rates), place.stage),
            parameters=[
                {**vars(own[p]), "value": _plain(own[p].value or 0.01), "far": f"{FAR:g}"}
                for p in _numbers(texts)
            ],
            places={p: k for k, p in enumerate(_numbers(texts))},
            neutral=" && ".join(f"v[{k}] == 0" for k in range(len(_numbers(texts)))),
            signs="sign" in used,
            ordered=bool(used & {"min", "max"}),
            formula=formula,
            rates=[_function(rate, place.names, state) for rate in rates.values()],
            wheels=place.wheels,
            pad="    " if place.wheels else "",
            stage=place.stage,
            signals=place.signals,
            names=[(n, source) for n, source in place.names.items() if n in used],
            acts=[act.format(f"Formula({formula.values})") for act in place.acts],
            act=place.act,
        )
    )


def _numbers(texts: dict[str, str]) -> list[str]:
    """Those of p0 to p3 that the texts name."""
    used = words(" ".join(texts.values()))
    return [p for p in FORMULA_NUMBERS if p in used]


def _kind(used: set[str], remembers: bool, stage: str) -> dict[str, str]:
    """Family, needs and drives of the card, by what the texts name."""
    if used & {"x", "y", "theta", "course"}:
        family = "kFrame" if stage == "observe" else "kPlace"
        return {"family": family, "needs": "kRoom", "identify": "kPlaces | kHeadings"}
    if remembers:
        return {"family": "kTransient", "needs": "kHistory", "identify": "kReversals | kLong"}
    if "V" in used:
        return {"family": "kPower", "needs": "kBattery", "identify": "kStraight | kLong"}
    if "angle" in used:
        return {"family": "kGeometry", "needs": "kWheelAngle", "identify": "kStraight"}
    if "t" in used:
        return {"family": "kGain", "needs": "kHistory", "identify": "kStraight | kLong"}
    turns = "kSpin | kArcs" if "omega" in used else "kStraight"
    return {"family": "kFriction", "needs": "kSteadySpeed", "identify": f"{turns} | kLevels"}


def _function(text: str, names: dict[str, str], state: dict[str, str]) -> Function:
    used = words(text)
    own = [n for n in (*names, *state) if n in used]
    numbers = [p for p in FORMULA_NUMBERS if p in used]
    return Function(
        in_cpp(text, {*names, *state, *FORMULA_NUMBERS}),
        ", ".join(["const Numbers &v"] * bool(numbers) + [f"double {n}" for n in own]),
        ", ".join(["v"] * bool(numbers) + own),
        numbers,
    )


def _test(name: str, texts: dict[str, str], own: dict[str, Own]) -> str:
    numbers = _numbers(texts)
    pairs = ", ".join(f'{{"{key}", {_quoted(text)}}}' for key, text in texts.items() if text)
    title = "".join(part.capitalize() for part in name.split("_"))
    template = _environment().get_template("test_effect.cpp.j2")
    return template.render(
        name=name,
        title=title,
        values=", ".join(_plain(own[p].value or 0.01) for p in numbers),
        places=", ".join(str(FORMULA_NUMBERS.index(p)) for p in numbers),
        texts=f"{{{pairs}}}",
        held=bool(words(" ".join(texts.values())) & CHANGING),
    )


def _quoted(text: str) -> str:
    """A text of C++: JSON has the same marks and escapes."""
    return json.dumps(text, ensure_ascii=False)


def _plain(value: float) -> str:
    return f"{value:.6g}"


def _wrapped(text: str) -> list[str]:
    return wrap(text, LONGEST, drop_whitespace=False, break_long_words=True)


def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("twinmill.export", "."),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=StrictUndefined,
    )
