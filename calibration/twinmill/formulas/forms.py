# SPDX-License-Identifier: Apache-2.0
"""Forms that a formula for what is left may have: where it acts, on what it depends, what it keeps.

A form is linear in its numbers. It may have one constant besides (a time, a length, a wave number),
and one state, which relaxes: ds/dt = rate (goal - s). Or its state swings, with its rate of change
as a second one: ds/dt = r, dr/dt = w^2 (goal - s) - 2 z w r.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from twinmill.formulas.term import CHANGE, CHANNELS, PAST, SPEEDS, STILL, TIME, WAY, times

STARTS = "starts"
HEADING = "heading"
RIM, TARGET = "rim_mps", "target"  # of each wheel: where a formula acts, and what it names
ROOM = "room_mps"  # a push along x and along y of the room, of which each has a shape
ALONG = ("(vx*cos(theta) - vy*sin(theta))", "(vx*sin(theta) + vy*cos(theta))")  # x and y
LEVER_M = 0.1  # turning counts as driving at this radius
SHORTEST_M = 0.3  # wave along the room
MOST_WAVES = 40
SHORTEST_S = 6.0  # what comes and goes with time
MOMENTS = 12  # at which something may begin or end
LONG_S = (5.0, 15.0, 45.0, 135.0)  # what warms up or recovers
LAGS_S = (0.15, 0.4, 1.0, 2.5)
RESTS_S = (0.3, 0.8, 2.0, 5.0)  # what a start or a rest is felt
AROUND = (0.2, 0.27, 0.36, 0.48, 0.64, 0.85)  # of a high speed, around which some is lost
WIDE = 0.4  # share of that speed, at which such a loss has ended
STORED = {"vx": (0.003, 0.01, 0.03), "vy": (0.003, 0.01, 0.03), "omega": (0.02, 0.06, 0.2)}
MOST_NUMBERS = 4  # the effect `equation` has p0 to p3
C, D, L = "{c}", "{d}", "{l}"  # the constant, the damping and the lever in texts
SWINGS_HZ = (0.55, 0.75, 1.0, 1.35, 1.8, 2.4, 3.2, 4.3)
DAMPINGS = (0.07, 0.3)
DAMPED = 2.2  # times which a better damping may differ
LEAST_DAMPED, MOST_DAMPED = 0.01, 0.8  # beyond it hardly anything overshoots


@dataclass(frozen=True)
class State:
    """Memory of a form: s goes to `goal` at `rate` per second, texts as the shapes are.

    Without a goal it adds up `rate`. Without a rate it swings around the goal, {c} per second, as
    {d} damps it. With a second goal there is one of them along x and another along y of the room.
    """

    goal: str
    rate: str
    goal_y: str = ""

    @property
    def swings(self) -> bool:
        """Its rate of change r is a second state."""
        return not self.rate

    @property
    def goals(self) -> tuple[str, ...]:
        """One, or along x and along y."""
        return (self.goal, self.goal_y) if self.goal_y else (self.goal,)

    @property
    def text(self) -> str:
        """The rate of change, as the effect `equation` takes it."""
        if self.swings:
            return "r"
        return f"({self.goal} - s)*{self.rate}" if self.goal else self.rate

    @property
    def second_text(self) -> str:
        """Formula of the second state r; empty if there is none."""
        swings = [f"{C}*{C}*({goal} - s) - 2*{D}*{C}*r" for goal in self.goals]
        return ", ".join(swings) if self.swings else ""


@dataclass(frozen=True)
class Form:
    """One term.

    Attributes:
        adds_to: where it acts, as the effect `equation` names it.
        shapes: each is multiplied by a number of its own.
        group: on what it depends.
        state: what it remembers; None if nothing.
        constant: written {c} in shapes and state; 0 where there is none.
        spread: share of the constant within which a better one may lie.
        unit: of the constant.
        damping: written {d} in a state that swings, 1 where it no longer would.
    """

    adds_to: str
    shapes: tuple[str, ...]
    group: str
    state: State | None = None
    constant: float = 0.0
    spread: float = 0.0
    unit: str = ""
    damping: float = 0.0

    @cached_property
    def texts(self) -> tuple[str, ...]:
        """The shapes with their constant."""
        return tuple(self.filled(s) for s in self.shapes)

    @cached_property
    def names_time(self) -> bool:
        """It holds of one run: no other shares its moments."""
        return re.search(r"\bt\b", " ".join((*self.texts, *self.rates))) is not None

    @cached_property
    def rates(self) -> tuple[str, ...]:
        """Rates of its states with its constants filled in; none if it has no state."""
        texts = (self.state.text, self.state.second_text) if self.state else ()
        return tuple(self.filled(t) for t in texts if t)

    @property
    def searched(self) -> tuple[str, ...]:
        """Names of the constants that it has."""
        return tuple(name for name in ("constant", "damping") if getattr(self, name))

    def at(self, constant: float) -> "Form":
        """Form with another value of its constant."""
        return replace(self, constant=float(f"{constant:.4g}"))

    def near(self, name: str, parts: np.ndarray) -> list["Form"]:
        """Forms with the constant further off, by parts of the step to a better one."""
        if name == "constant":
            return [self.at(self.constant * (1 + self.spread * part)) for part in parts]
        tried = np.clip(self.damping * DAMPED**parts, LEAST_DAMPED, MOST_DAMPED)
        return [replace(self, damping=float(f"{d:.3g}")) for d in np.unique(tried)]

    def filled(self, text: str) -> str:
        """A text of it with its constants."""
        places = {C: f"{self.constant:.4g}", D: f"{self.damping:.3g}", L: f"{LEVER_M:g}"}
        for place, value in places.items():
            text = text.replace(place, value)
        return text

    @property
    def equation(self) -> dict[str, str]:
        """Texts of the effect `equation`, its numbers p0 and so on."""
        formula = self.with_numbers([f"p{k}" for k in range(len(self.shapes))])
        rates = zip(("state_rate", "second_rate"), self.rates, strict=False)
        return {"adds_to": self.adds_to, "formula": formula} | dict(rates)

    def with_numbers(self, numbers: Sequence[str]) -> str:
        """Sum of these numbers times shapes; of a push in the room two, along x and along y."""
        terms = [f"{number}*{text}" for number, text in zip(numbers, self.texts, strict=True)]
        values = [terms[0::2], terms[1::2]] if self.adds_to == ROOM else [terms]
        return ", ".join(" + ".join(own) for own in values).replace("+ -", "- ")

    def told(self, numbers: Sequence[str]) -> str:
        """As `with_numbers`, with how its states change."""
        rates = [f"{of} = {rate}" for of, rate in zip(("ds/dt", "dr/dt"), self.rates, strict=False)]
        return self.with_numbers(numbers) + (f" with {' and '.join(rates)}" if rates else "")


def names_of(
    velocity: np.ndarray, place: np.ndarray, theta_rad: np.ndarray, t_s: np.ndarray
) -> dict[str, np.ndarray]:
    """(N,) each name of the motion that forms follow, as the effect `equation` has them.

    Args:
        velocity: (N, 3) of the body, m/s and rad/s.
        place: (N, 2) in m.
        theta_rad: (N,) headings.
        t_s: (N,) times.
    """
    vx, vy, omega = np.where(np.abs(velocity) < STILL, 0.0, velocity).T
    names = dict(
        vx=vx,
        vy=vy,
        omega=omega,
        x=place[:, 0],
        y=place[:, 1],
        theta=theta_rad,
        t=t_s,
    )
    return {name: np.ascontiguousarray(values) for name, values in names.items()}


def own_forms(every: Mapping[str, np.ndarray], sideways: bool, wheels: bool) -> list[Form]:
    """Forms that follow from a motion.

    Args:
        every: (N,) of all logs by the names of the motion.
        sideways: the robot can move to its left.
        wheels: the model has wheels.
    """
    return [
        *_of_room(every, sideways),
        *_of_time(every),
        *_of_load(),
        *_of_speed(),
        *_around_a_speed(every),
        *(f for axis in SPEEDS if sideways or axis != "vy" for f in _late(axis)),
        *(_late_wheels() if wheels else ()),
        *(f for axis in SPEEDS if sideways or axis != "vy" for f in _overshoots(axis)),
        *(_overshoots(TARGET, "r") if wheels else ()),
        *_sways(),
    ]


def _of_room(every: Mapping[str, np.ndarray], sideways: bool) -> list[Form]:
    """Forms of place, heading and, where they differ, the direction in which it drives."""
    found = []
    for name in ("x", "y"):
        span = np.ptp(every[name])
        if span < SHORTEST_M:
            continue
        count = int(min(2 * span / SHORTEST_M, MOST_WAVES))
        for k in range(2, count + 1):
            found.append(_wave("travel", name, k, span))
        found.append(Form("travel", (name,), "place"))
    if np.ptp(every["theta"]) > 0.5:
        found.append(Form(ROOM, ("sqrt(vx*vx + vy*vy)",) * 2, HEADING))
        for n in (1, 2, 3, 4):
            pair = f"cos({times(n, 'theta')})", f"sin({times(n, 'theta')})"
            found += [Form(to, pair, HEADING) for to in ("travel", "theta_rad")]
            found.append(Form("omega_radps", tuple(f"{p}*omega" for p in pair), HEADING))
            courses = tuple(p.replace("theta", "course") for p in pair)
            found.append(Form("aside", courses, HEADING))
            found += [Form("travel", courses, HEADING)] * sideways
    return found


def _of_time(every: Mapping[str, np.ndarray]) -> list[Form]:
    """Forms in time: some come and go, some begin, some last for a while."""
    first, span = every["t"].min(), np.ptp(every["t"])
    count = int(min(2 * span / SHORTEST_S, MOST_WAVES))
    found = [
        _wave(to, "t", k, span)
        for to in ("travel", "motion", "omega_radps")
        for k in range(1, count + 1)
    ]
    at = [float(f"{first + span * k / MOMENTS:.4g}") for k in range(1, MOMENTS)]
    found += [Form("motion", (f"(t > {a:g})",), TIME) for a in at]
    found += [Form("motion", (f"(t > {a:g})*(t < {b:g})",), TIME) for a in at for b in at if a < b]
    return found


def _wave(adds_to: str, name: str, k: int, span: float) -> Form:
    """That has k half waves in what the logs span of a name of the motion."""
    pair = f"cos({C}*{name})", f"sin({C}*{name})"
    group, unit = (TIME, "1/s") if name == "t" else ("place", "1/m")
    constant = float(f"{np.pi * k / span:.4g}")
    return Form(adds_to, pair, group, constant=constant, spread=0.5 / k, unit=unit)


def _of_load() -> list[Form]:
    """Forms that warm up, empty, recover or wear: a state that follows how hard it drives."""
    turning = f"{L}*{L}*omega*omega"
    load, rate = f"(vx*vx + vy*vy + {turning})", f"(1/{C})"
    way = f"sqrt(vx*vx + vy*vy + {turning})"
    found = [
        Form("motion", ("s",), PAST, State(of, rate), constant=long_s, spread=0.4, unit="s")
        for of in (load, way)
        for long_s in LONG_S
    ]
    found += [
        Form(to, (f"s*{axis}",), PAST, State(of, rate), constant=long_s, spread=0.4, unit="s")
        for to, axis in zip(CHANNELS, SPEEDS, strict=True)
        for of in (f"{axis}*{axis}", f"abs({axis})")
        for long_s in LONG_S
    ]
    found += [
        Form("motion", ("(moves - s)",), STARTS, State("moves", rate), rest_s, 0.4, "s")
        for rest_s in RESTS_S
    ]
    return [*found, Form("motion", ("s",), WAY, State("", way))]


def _of_speed() -> list[Form]:
    """Losses of way that speeds or turning cause."""
    shapes = (
        ("speed", "sqrt(vx*vx + vy*vy)"),
        ("speed", "(vx*vx + vy*vy)"),
        ("turning rate", "abs(omega)"),
        ("turning rate", "omega*omega"),
    )
    return [Form("travel", (shape,), group) for group, shape in shapes]


def _around_a_speed(every: Mapping[str, np.ndarray]) -> list[Form]:
    """Forms of a gain or loss around one speed, as a motor or the body has at a resonance."""
    found = []
    vx, vy, omega = (np.abs(every[axis]) for axis in SPEEDS)
    speeds = (
        ("vx_mps", "vx*", "abs(vx)", vx),
        ("vy_mps", "vy*", "abs(vy)", vy),
        ("omega_radps", "omega*", "abs(omega)", omega),
        ("travel", "", "sqrt(vx*vx + vy*vy)", np.hypot(vx, vy)),
    )
    for to, carrier, speed, values in speeds:
        if not values.any():
            continue
        group, unit = ("turning rate", "rad/s") if values is omega else ("speed", "m/s")
        shape = f"{carrier}max(0, 1 - abs({speed}/{C} - 1)/{WIDE:g})"
        for at in np.quantile(values[values > 0], 0.95) * np.array(AROUND):
            found.append(Form(to, (shape,), group, None, float(f"{at:.3g}"), 0.25, unit))
    return found


def _late_wheels() -> list[Form]:
    """A second lag of all wheels: they creep to their speed, or go beyond it first."""
    lag = State(TARGET, f"(1/{C})")
    return [Form(RIM, (f"({TARGET} - s)",), PAST, lag, lag_s, 0.4, "s") for lag_s in LAGS_S]


def _late(axis: str) -> list[Form]:
    """Forms of a speed's past: a second lag, and way that each reversal stores first."""
    to = {"vx": "vx_mps", "vy": "vy_mps", "omega": "omega_radps"}[axis]
    lag, stored = State(axis, f"(1/{C})"), State(f"{C}*sign({axis})", f"(abs({axis})/{C})")
    found = [Form(to, (f"({axis} - s)",), PAST, lag, lag_s, 0.4, "s") for lag_s in LAGS_S]
    unit = "rad" if axis == "omega" else "m"
    for reach in STORED[axis]:
        for shape in (f"({axis} - abs({axis})*s/{C})", "s"):
            found.append(Form(to, (shape,), PAST, stored, reach, 0.4, unit))
    return found


def _overshoots(goal: str, *rate: str) -> list[Form]:
    """A speed of the body or of all wheels swings around what it should be, a part of it or all.

    A controller has a say in how a speed loop begins: then its rate of change counts, too.
    """
    to = {**dict(zip(SPEEDS, CHANNELS, strict=True)), TARGET: RIM}[goal]
    shapes = [(f"(s - {goal})",), (f"(s - {goal})", *rate)]
    return [f for own in dict.fromkeys(shapes) for f in _swings(to, own, State(goal, ""))]


def _sways() -> list[Form]:
    """The marker's mast is bent by the robot's acceleration, along x and along y of the room."""
    shapes = tuple(f"(s + 2*{D}*r/{C} - {way})" for way in ALONG)
    return _swings(ROOM, shapes, State(ALONG[0], "", ALONG[1]))


def _swings(to: str, shapes: tuple[str, ...], state: State) -> list[Form]:
    """One for each frequency and damping, between which the search then goes on."""
    return [
        Form(to, shapes, CHANGE, state, 2 * np.pi * hz, 0.16, "1/s", damping=damping)
        for hz in SWINGS_HZ
        for damping in DAMPINGS
    ]
