# SPDX-License-Identifier: Apache-2.0
"""Source, card and test of an effect for the catalogue, from the equation of a model."""

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap

from jinja2 import Environment, PackageLoader, StrictUndefined

from twinmill.diagnosis.trials import REFIT
from twinmill.fitting.add import OWN_GAINS
from twinmill.model.model_file import ModelError, ModelFile, write_whole
from twinmill.model.parameters import catalogue, effect_names, words

CATALOGUE, TESTS = Path("twin/effects/catalogue"), Path("tests/effects")
LISTED = "add_executable(test_effects\n"  # in the tests' CMakeLists.txt; the new one follows
NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
TOKEN = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[A-Za-z_]\w*|\s+|.")
PARAMETERS = ("p0", "p1", "p2", "p3")
FAR = 1e6  # of any number: its size is the formula's
LONGEST = 78  # of a text in the card
NEW = "new"  # in the place of an effect's name
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
RATES = {"state_rate": "s", "second_rate": "r"}
FUNCTIONS = {
    **{n: f"std::{n}" for n in ("abs", "sqrt", "exp", "sin", "cos", "tan", "min", "max")},
    **{n: f"std::{n}" for n in ("asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh")},
    **{n: f"std::{n}" for n in ("asinh", "acosh", "atanh", "log2", "log10", "rint")},
    "ln": "std::log",
    "sign": "Sign",
}
OF_ANY_COUNT = ("min", "max")  # of arguments
FIGURES = {"_pi": "M_PI", "_e": "M_E"}


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
class Function:
    """A C++ function of one text: its arguments, what is passed, the numbers that it names."""

    text: str
    arguments: str
    values: str
    parameters: Sequence[str]


def write_effect(name: str, model_file: ModelFile, instance: str, root: Path) -> list[Path]:
    """Writes the source and the test of an effect, and lists the test for the build.

    Args:
        name: of the new effect.
        model_file: that has the equation.
        instance: of the equation in it: `equation`, `equation#2`.
        root: of the project's source.

    Returns:
        The files written.

    Raises:
        ValueError: the name is no name or is taken, or the formula cannot be said in C++.
        ModelError: the model has no such equation, or `root` is not the project's source.
    """
    source, test = root / CATALOGUE / f"{name}.cpp", root / TESTS / f"test_{name}.cpp"
    lists = root / TESTS / "CMakeLists.txt"
    _check(name, root, (source, test))
    listed = lists.read_text()
    if LISTED not in listed:
        raise ModelError(f"{lists}: has no line '{LISTED.strip()}'; list the test there by hand.")
    model = model_file.model
    if instance not in effect_names(model) or not instance.startswith("equation"):
        has = [n for n in effect_names(model) if n.split("#")[0] == "equation"]
        raise ModelError(
            f"{model_file.path.name}: has no '{instance}'; "
            + (f"its equations are {', '.join(has)}." if has else "it has no equation at all.")
        )
    texts = model.texts[effect_names(model).index(instance)]
    if texts["adds_to"] not in PLACES:
        raise ValueError(
            f"{instance}: adds to {texts['adds_to']}, which has two values, and only formulas of "
            "one value are written as an effect; keep the equation in the model."
        )
    values = {p: model.get(f"{instance}.{p}") for p in PARAMETERS}
    made = _source(name, texts, values, model_file.path.name)
    tested = _test(name, texts, values)
    write_whole(source, made)
    write_whole(test, tested)
    write_whole(lists, listed.replace(LISTED, f"{LISTED}    test_{name}.cpp\n", 1))
    return [source, test, lists]


def _check(name: str, root: Path, files: Sequence[Path]) -> None:
    if not NAME.fullmatch(name):
        raise ValueError(
            f"effect '{name}': is no name; use small letters, figures and single underscores."
        )
    if name in RESERVED:
        raise ValueError(f"effect '{name}': commands mean something else by it; take another name.")
    if name in catalogue():
        raise ValueError(f"effect '{name}': the catalogue has it already; take another name.")
    needed = (CATALOGUE, TESTS / "CMakeLists.txt")
    if missing := next((place for place in needed if not (root / place).exists()), None):
        raise ModelError(
            f"{root}: holds no {missing}, so it is not the project's source; run this there, or "
            "name it with --into."
        )
    if there := next((f for f in files if f.exists()), None):
        raise ValueError(f"{there}: exists already; take another name, or remove it.")


def _source(name: str, texts: dict[str, str], values: dict[str, float], model: str) -> str:
    place = PLACES[texts["adds_to"]]
    rates = {of: texts[key] for key, of in RATES.items() if texts.get(key)}
    used = words(" ".join([texts["formula"], *rates.values()]))
    state = {of: of for of in rates}
    formula = _function(texts["formula"], place.names, state)
    what = "adds" if texts["adds_to"] not in SHARES else "changes by a share"
    equation = f"{what} to {texts['adds_to']}: {texts['formula']}"
    equation += "".join(f"; d{of}/dt = {rate}, {of} = 0 at the start" for of, rate in rates.items())
    return (
        _environment()
        .get_template("effect.cpp.j2")
        .render(
            name=name,
            summary="Taken from an equation that was found for what a model lacked.",
            equation="\n".join(f'        "{line}"' for line in _wrapped(equation)),
            measure="drives that vary the quantities in the equation; what it resembles is its own",
            reference=f"found in data by twinmill diagnose; {model}",
            phrase="a formula that was found in data",
            **_kind(used, bool(rates), place.stage),
            parameters=[
                {"name": p, "value": _plain(values[p] or 0.01), "far": f"{FAR:g}"}
                for p in _numbers(texts)
            ],
            neutral=" && ".join(f"v[{k}] == 0" for k in range(len(_numbers(texts)))),
            signs="sign" in used,
            ordered=bool(used & {*OF_ANY_COUNT}),
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
    """p0 and so on, as far as the texts name them."""
    used = words(" ".join(texts.values()))
    last = max((k for k, p in enumerate(PARAMETERS) if p in used), default=0)
    return list(PARAMETERS[: last + 1])


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
    numbers = [p for p in PARAMETERS if p in used]
    return Function(
        _in_cpp(text, {*names, *state, *PARAMETERS}),
        ", ".join(["const Numbers &v"] * bool(numbers) + [f"double {n}" for n in own]),
        ", ".join(["v"] * bool(numbers) + own),
        numbers,
    )


def _in_cpp(text: str, names: Collection[str]) -> str:
    """A formula of some names as C++ reads it: figures with a point, functions of its library.

    Raises:
        ValueError: C++ has no such function or sign.
    """
    spaced = re.sub(
        r"(?<=[\w)}]) *([*/]) *", r" \1 ", _terms(iter(TOKEN.findall(text)), text, names)
    )
    return re.sub(r"\s+", " ", spaced)


def _terms(tokens: Iterator[str], text: str, names: Collection[str]) -> str:
    """Of a formula's tokens up to the end of the bracket that they stand in."""
    parts = []
    for token in tokens:
        if token == ")":
            break
        if token == "(":
            parts.append(f"({_terms(tokens, text, names)})")
        elif token in FUNCTIONS:
            while next(tokens) != "(":
                pass
            parts.append(_called(token, _terms(tokens, text, names)))
        else:
            parts.append(_plain_token(token, text, names))
    return "".join(parts)


def _called(function: str, arguments: str) -> str:
    """A call; what compares is a number to the formula, and a truth to C++."""
    own = [
        f"static_cast<double>({a.strip()})" if re.search(r"[<>=&|]", a) and "?" not in a else a
        for a in _arguments(arguments)
    ]
    inside = ",".join(own)
    return f"{FUNCTIONS[function]}({f'{{{inside}}}' if function in OF_ANY_COUNT else inside})"


def _arguments(text: str) -> list[str]:
    """Parts between the commas that stand in no bracket."""
    found, depth = [""], 0
    for letter in text:
        depth += (letter in "({") - (letter in ")}")
        if letter == "," and not depth:
            found.append("")
        else:
            found[-1] += letter
    return found


def _plain_token(token: str, text: str, names: Collection[str]) -> str:
    """A figure, a name or a sign."""
    if token == "^":
        raise ValueError(f"'{text}': C++ has no power by ^; write x*x or exp(2*ln(x)).")
    if re.match(r"[\d.]", token):
        return token if re.search(r"[.eE]", token) else f"{token}.0"
    if re.match(r"[A-Za-z_]", token) and token not in names and token not in FIGURES:
        raise ValueError(
            f"'{text}': {token} is not written in C++; say it by other functions, such as a + b "
            "for sum(a, b), or keep the equation in the model."
        )
    return FIGURES.get(token, token)


def _test(name: str, texts: dict[str, str], values: dict[str, float]) -> str:
    own = [_plain(values[p] or 0.01) for p in _numbers(texts)]
    pairs = ", ".join(f'{{"{key}", "{text}"}}' for key, text in texts.items() if text)
    title = "".join(part.capitalize() for part in name.split("_"))
    template = _environment().get_template("test_effect.cpp.j2")
    return template.render(name=name, title=title, values=", ".join(own), texts=f"{{{pairs}}}")


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
