# SPDX-License-Identifier: Apache-2.0
"""Forms that a formula for what is left may have: where it acts, on what it depends, what it keeps.

A form is linear in its numbers. It may have one constant besides (a time, a length, a wave number),
and one state, which relaxes: ds/dt = rate (goal - s). Or its state swings, with its rate of change
as a second one: ds/dt = r, dr/dt = w^2 (goal - s) - 2 z w r. How the rows of a fit change by it
follows from the predicted motion, without a pass of the plant.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from itertools import cycle, pairwise
from types import CodeType, MappingProxyType

import numpy as np

from twinmill.filters import Swing, faded
from twinmill.fitting.opening import Opened
from twinmill.fitting.response import Response
from twinmill.formulas.term import (
    CHANGE,
    CHANNELS,
    PAST,
    SPEEDS,
    STILL,
    SWELL,
    TIME,
    TYPICAL,
    WAY,
    Term,
    displaced_by,
    times,
)
from twinmill.model.parameters import words

STARTS = "starts"
HEADING = "heading"
RIM, TARGET = "rim_mps", "target"  # of each wheel: where a formula acts, and what it names
ROOM = "room_mps"  # a push along x and along y of the room, of which each has a shape
ALONG = ("(vx*cos(theta) - vy*sin(theta))", "(vx*sin(theta) + vy*cos(theta))")  # x and y
ALL_AXES = {"travel": (0, 1), "motion": (0, 1, 2)}  # shares of these axes of the body
HEADING_RAD = 0.02  # usual error of a captured heading
USUAL = {**TYPICAL, "travel": SWELL, "motion": SWELL, "aside": SWELL, "theta_rad": HEADING_RAD}
USUAL |= {ROOM: TYPICAL["vx_mps"]}
LEVER_M = 0.1  # turning counts as driving at this radius
SHORTEST_M = 0.3  # wave along the room
SHARP = 0.005  # share of the rate of a beat within which a better one may lie
MOST_WAVES = 40
SHORTEST_S = 6.0  # what comes and goes with time
MOMENTS = 12  # at which something may begin or end
LONG_S = (5.0, 15.0, 45.0, 135.0)  # what warms up or recovers
LAGS_S = (0.15, 0.4, 1.0, 2.5)
RESTS_S = (0.3, 0.8, 2.0, 5.0)  # what a start or a rest is felt
AROUND = (0.2, 0.27, 0.36, 0.48, 0.64, 0.85)  # of a high speed, around which some is lost
WIDE = 0.4  # share of that speed, at which such a loss has ended
STORED = {"vx": (0.003, 0.01, 0.03), "vy": (0.003, 0.01, 0.03), "omega": (0.02, 0.06, 0.2)}
NAMED = ("vx", "vy", "omega", "x", "y", "theta", "course", "t")  # as formulas are told
ANGLES = ("theta", "course")
MOST_NUMBERS = 4  # the effect `equation` has p0 to p3
C, D, L = "{c}", "{d}", "{l}"  # the constant, the damping and the lever in texts
A = "{a}"  # the angle of a period at time 0
PLACES = {"constant": C, "damping": D, "phase": A}
NAMES = str.maketrans("", "", "{}")  # makes names of these
SWINGS_HZ = (0.55, 0.75, 1.0, 1.35, 1.8, 2.4, 3.2, 4.3)
DAMPINGS = (0.07, 0.3)
DAMPED = 2.2  # times which a better damping may differ
LEAST_DAMPED, MOST_DAMPED = 0.01, 0.8  # beyond it hardly anything overshoots
MOST_POINTS = 10_000  # of all logs, about, by which the size of a form is told
TOGETHER = 16  # forms of which the values stay near the processor until they are summed up
FUNCTIONS = {"abs": np.abs, "sign": np.sign, "sqrt": np.sqrt, "cos": np.cos, "sin": np.sin}
FUNCTIONS["max"] = np.maximum


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
        column: number of the library's term whose column it has; -1: it is made here.
        sizes: of the shapes' values; empty until `sized`.
        command_unit: of the command u, where a shape names it.
        damping: written {d} in a state that swings, 1 where it no longer would.
        figures: fitted constants that the shapes have as figures.
        phase: rad, written {a} in a shape that comes back by the clock; None of all others.
    """

    adds_to: str
    shapes: tuple[str, ...]
    group: str
    state: State | None = None
    constant: float = 0.0
    spread: float = 0.0
    unit: str = ""
    column: int = -1
    sizes: tuple[float, ...] = ()
    command_unit: str = ""
    damping: float = 0.0
    figures: int = 0
    phase: float | None = None

    @cached_property
    def texts(self) -> tuple[str, ...]:
        """The shapes with their constant."""
        return tuple(self.filled(s) for s in self.shapes)

    @property
    def of_body(self) -> bool:
        """All that it names is of the body's motion, and not of wheels."""
        return self.adds_to != RIM

    @property
    def of_one_value(self) -> bool:
        """True if it changes one quantity of the motion, which can be drawn over a variable."""
        return self.of_body and self.adds_to != ROOM

    @cached_property
    def names_time(self) -> bool:
        """It holds of one run: no other shares its moments."""
        return "t" in names_in([*self.texts, *self.rates])

    @property
    def wave(self) -> tuple[str, float]:
        """Name of the motion along which it swings, and at what rate; empty and 0 if at none."""
        shape = self.shapes[0]
        if self.constant and shape.startswith("cos("):
            return shape.split("*")[-1].rstrip(")"), self.constant
        if self.recurs:
            return "t", float(re.search(r"sin\(([\d.]+)\*t", shape)[1])
        return "", 0.0

    @property
    def recurs(self) -> bool:
        """It is there for a part of each period, by the clock."""
        return self.phase is not None

    @cached_property
    def rates(self) -> tuple[str, ...]:
        """Rates of its states with its constants filled in; none if it has no state."""
        texts = (self.state.text, self.state.second_text) if self.state else ()
        return tuple(self.filled(t) for t in texts if t)

    @property
    def is_late(self) -> bool:
        """A speed follows late by it, or swings."""
        state = self.state
        return bool(state) and (state.swings or state.goal in (*SPEEDS, TARGET))

    @property
    def plainer(self) -> "Form | None":
        """Form without the rate of change of a swinging quantity; None if it does not name it."""
        plain = tuple(s for s in self.shapes if s != "r")
        return replace(self, shapes=plain, sizes=()) if plain != self.shapes else None

    @property
    def searched(self) -> tuple[str, ...]:
        """Names of the constants that it has."""
        return tuple(name for name in ("constant", "damping") if getattr(self, name))

    @cached_property
    def numbers(self) -> int:
        """Fitted ones, constants among them."""
        return self.places + len(self.searched) + self.figures

    @property
    def places(self) -> int:
        """Numbers of the effect `equation` that it takes: of its shapes, and its phase."""
        return len(self.shapes) + self.recurs

    @cached_property
    def constants(self) -> dict[str, str]:
        """As its texts have them."""
        found = {"constant": f"{self.constant:.4g}", "damping": f"{self.damping:.3g}"}
        return found if self.phase is None else found | {"phase": f"{self.phase:.3f}"}

    @property
    def strengths(self) -> np.ndarray:
        """Numbers at which each shape adds what is typical."""
        return USUAL[self.adds_to] / np.array(self.sizes)

    def without(self, k: int) -> "Form":
        """Form less one of its shapes."""
        shapes, sizes = ((*own[:k], *own[k + 1 :]) for own in (self.shapes, self.sizes))
        return replace(self, shapes=shapes, sizes=sizes, column=-1)

    def at(self, constant: float) -> "Form":
        """Form with another value of its constant."""
        return replace(self, constant=float(f"{constant:.4g}"), sizes=())

    def near(self, name: str, parts: np.ndarray) -> list["Form"]:
        """Forms with the constant further off, by parts of the step to a better one."""
        if name == "constant":
            return [self.at(self.constant * (1 + self.spread * part)) for part in parts]
        tried = np.clip(self.damping * DAMPED**parts, LEAST_DAMPED, MOST_DAMPED)
        return [replace(self, damping=float(f"{d:.3g}"), sizes=()) for d in np.unique(tried)]

    def filled(self, text: str, names: Mapping[str, str] = MappingProxyType({})) -> str:
        """A text of it with its constants; those that have a name there have that."""
        if "{" not in text:
            return text
        for key, value in (self.constants | {**names}).items():
            text = text.replace(PLACES[key], value)
        return text.replace(L, f"{LEVER_M:g}")


GAINS = tuple(Form(to, (axis,), "") for to, axis in zip(CHANNELS, SPEEDS, strict=True))


@dataclass(frozen=True)
class Motion:
    """Logs as the model moves in them, one after the other, at points of their floors' responses.

    Attributes:
        logs: in this order.
        velocity: (N, 3) of the body, m/s and rad/s.
        names: (N,) each, as the effect `equation` names them.
        horizons: numbers of those that count here: the rest would choose the same.
    """

    logs: Sequence[Opened]
    velocity: np.ndarray
    names: Mapping[str, np.ndarray]
    horizons: Sequence[int]
    _known: dict[tuple, np.ndarray] = field(default_factory=dict, repr=False)
    _swinging: dict[tuple, list[Swing]] = field(default_factory=dict, repr=False)

    @classmethod
    def of(
        cls, logs: Sequence[Opened], velocities: Sequence[np.ndarray], horizons: Sequence[int]
    ) -> "Motion":
        """Motion of logs at (N, 3) velocities in each."""
        responses = [own.response for own in logs]
        velocity = np.concatenate(velocities)
        names = names_of(
            velocity,
            np.concatenate([r.pose[:, :2] for r in responses]),
            np.concatenate([r.heading_rad for r in responses]),
            np.concatenate([r.middle_s for r in responses]),
        )
        return cls(logs, velocity, names, horizons)

    @cached_property
    def parts(self) -> list[slice]:
        """The points of each log."""
        ends = np.cumsum([0, *(len(own.response.step_s) for own in self.logs)])
        return [slice(a, b) for a, b in pairwise(ends.tolist())]

    @cached_property
    def _step_s(self) -> np.ndarray:
        """(N,) of which the first of each log is 0."""
        return np.concatenate([own.response.step_s for own in self.logs])

    @cached_property
    def _captured_rad(self) -> np.ndarray:
        """(N,) headings as they are captured at the points."""
        heading = [own.track.heading_smooth for own in self.logs]
        pairs = zip(heading, self.logs, strict=True)
        return np.nan_to_num(np.concatenate([h[own.response.points] for h, own in pairs]))

    def _each(self, made: Callable[..., np.ndarray], *values: np.ndarray) -> np.ndarray:
        """(..., N) made of (N,) values, of each log by itself."""
        return np.concatenate([made(*(v[p] for v in values)) for p in self.parts], axis=-1)

    def values(self, form: Form) -> np.ndarray:
        """(k, N) of a form's shapes; of one of all wheels for a robot that drives on."""
        return self._along(form, "vx")

    def _along(self, form: Form, axis: str) -> np.ndarray:
        """Rewrites a form of the wheels' speed for a speed of the body."""
        wheels = axis if not form.of_body else ""
        key = (form.adds_to, wheels, form.shapes, form.state, *form.constants.values())
        if key not in self._known:
            self._known[key] = self._computed(form, axis)
        return self._known[key]

    def _computed(self, form: Form, axis: str) -> np.ndarray:
        names = {**self.names, TARGET: self.names[axis], L.translate(NAMES): LEVER_M}
        names |= {PLACES[k].translate(NAMES): float(v) for k, v in form.constants.items()}
        if form.adds_to == "theta_rad":
            names["theta"] = self._captured_rad
        states = [{}]
        if form.state and form.state.swings:
            goals = (axis if goal == TARGET else goal for goal in form.state.goals)
            states = [self._swung(form, goal) for goal in goals]
        elif form.state:
            states = [{"s": self._remembered(form, names)}]
        found = np.empty((len(form.shapes), len(names["t"])))
        for row, text, own in zip(found, form.shapes, cycle(states), strict=False):
            row[:] = _value(text, names | own)
        return found

    def _swung(self, form: Form, goal: str) -> dict[str, np.ndarray]:
        """(N,) means over each step of s and r that swing around a goal."""
        key = ("swing", goal, form.constant, form.damping)
        if key not in self._known:
            pushes = self._in_the_middle(goal)
            swings = zip(self._swings(form.constant, form.damping), self.parts, strict=True)
            found = [swing.around(pushes[part]) for swing, part in swings]
            self._known[key] = np.concatenate(found, axis=-1)
        return dict(zip(("s", "r"), self._known[key], strict=True))

    def _swings(self, rate: float, damping: float) -> list[Swing]:
        """Oscillators around any goal, for each log."""
        if (rate, damping) not in self._swinging:
            found = [Swing(self._step_s[part], rate, damping) for part in self.parts]
            self._swinging[rate, damping] = found
        return self._swinging[rate, damping]

    def _in_the_middle(self, goal: str) -> np.ndarray:
        """(N,) of a goal in the middle of each step.

        A step of several poses has the values from its last one.
        """
        key = ("middle", goal)
        if key not in self._known:
            values = _value(goal, self.names)
            self._known[key] = values - self._sooner * np.diff(values, prepend=values[:1])
        return self._known[key]

    @cached_property
    def _sooner(self) -> np.ndarray:
        """(N,) half the share of a step at the end of which a value is held; 0 without a step."""
        last_s = [own.track.timing.pose_period_s for own in self.logs]
        last_s = np.repeat(last_s, [p.stop - p.start for p in self.parts])
        moved = self._step_s > 0
        return np.clip(1 - last_s / np.where(moved, self._step_s, np.inf), 0, 1) / 2 * moved

    def _remembered(self, form: Form, names: Mapping[str, np.ndarray]) -> np.ndarray:
        """(N,) the state's mean over each step."""
        goal, rate = (
            np.broadcast_to(_value(t or "0", names), self._step_s.shape)
            for t in (form.state.goal, form.state.rate)
        )
        if not form.state.goal:
            return self._each(np.cumsum, rate * self._step_s) - rate * self._step_s / 2
        keep = np.exp(-rate * self._step_s)
        return self._each(_mean_faded, keep, goal * (1 - keep))

    def columns(self, forms: Sequence[Form], kept: Sequence[np.ndarray]) -> np.ndarray:
        """(R, K) change of the logs' errors by each number of some forms, in floors.

        Args:
            forms: of known sizes.
            kept: (W, H, 3) bool of each log: R in all of them.
        """
        ends = np.cumsum([0, *(len(f.shapes) for f in forms)])
        pairs = zip(self.logs, kept, strict=True)
        weights = [
            np.nan_to_num(o.trajectory.weight[:, self.horizons][k])[:, None] for o, k in pairs
        ]
        rows = [np.flatnonzero(k) for k in kept]
        found = np.empty((sum(np.count_nonzero(k) for k in kept), ends[-1]))
        for adds_to in dict.fromkeys(f.adds_to for f in forms):
            own = [k for k, f in enumerate(forms) if f.adds_to == adds_to]
            for some in (own[n : n + TOGETHER] for n in range(0, len(own), TOGETHER)):
                where = np.concatenate([np.arange(ends[k], ends[k + 1]) for k in some])
                changes, first = self._displaced(adds_to, [forms[k] for k in some]), 0
                for change, inside, weight in zip(changes, rows, weights, strict=True):
                    judged = change.reshape(-1, len(where)).take(inside, axis=0)
                    judged *= weight
                    found[first : first + len(inside), where] = judged
                    first += len(inside)
        return found

    def _displaced(self, adds_to: str, forms: Sequence[Form]) -> Iterator[np.ndarray]:
        """(W, H, 3, K) change of each log's displacements by some forms, all of one place."""
        axes = SPEEDS if adds_to == RIM else ("vx",)  # wheels and body are in proportion
        every = [[(self._along(f, axis), f.strengths[:, None]) for f in forms] for axis in axes]
        for log, part in zip(self.logs, self.parts, strict=True):
            response = copy(log.response)
            response.ends = response.ends[:, self.horizons]
            rows = (np.concatenate([v[:, part] * s for v, s in known]) for known in every)
            values = [np.ascontiguousarray(own.T) for own in rows]
            if adds_to == "theta_rad":
                yield _turned(response, values[0], log.trajectory.measured[:, self.horizons])
            else:
                pushes = self._pushes(adds_to, values, part)
                yield displaced_by(response, self.velocity[part], pushes)

    def _pushes(
        self, adds_to: str, values: Sequence[np.ndarray], part: slice
    ) -> dict[int, np.ndarray]:
        """(n, K) velocities in axes of the body, by (n, K) values at some points."""
        velocity = self.velocity[part]
        if adds_to == RIM:
            return dict(enumerate(values))
        (own,) = values
        if adds_to in CHANNELS:
            return {CHANNELS.index(adds_to): own}
        if adds_to == ROOM:
            return _in_body(own, self.names["theta"][part])
        if adds_to == "aside":
            return {0: -velocity[:, [1]] * own, 1: velocity[:, [0]] * own}
        return {axis: velocity[:, [axis]] * own for axis in ALL_AXES[adds_to]}


def names_of(
    velocity: np.ndarray, place: np.ndarray, theta_rad: np.ndarray, t_s: np.ndarray
) -> dict[str, np.ndarray]:
    """(N,) each name of the motion, as the effect `equation` has them.

    Args:
        velocity: (N, 3) of the body, m/s and rad/s.
        place: (N, 2) in m.
        theta_rad: (N,) headings.
        t_s: (N,) times.
    """
    vx, vy, omega = np.where(np.abs(velocity) < STILL, 0.0, velocity).T
    names = dict(
        moves=(np.abs(velocity) > STILL).any(axis=1) * 1.0,
        vx=vx,
        vy=vy,
        omega=omega,
        x=place[:, 0],
        y=place[:, 1],
        theta=theta_rad,
        course=theta_rad + np.arctan2(vy, vx),
        t=t_s,
    )
    return {name: np.ascontiguousarray(values) for name, values in names.items()}


def _mean_faded(keep: np.ndarray, pushes: np.ndarray) -> np.ndarray:
    """(N,) means over each step of what fades."""
    after = faded(keep, pushes)
    return (after + np.append(0.0, after[:-1])) / 2


def _in_body(pushes: np.ndarray, theta_rad: np.ndarray) -> dict[int, np.ndarray]:
    """(N, K) ahead and to the left, of (N, K) along x and along y of the room in turn."""
    along_x = np.arange(pushes.shape[1]) % 2 == 0
    c, s = np.cos(theta_rad)[:, None], np.sin(theta_rad)[:, None]
    return {0: pushes * np.where(along_x, c, s), 1: pushes * np.where(along_x, -s, c)}


def _turned(response: Response, error_rad: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """(W, H, 3, K) change of (W, H, 3) measured displacements by (N, K) errors of the heading."""
    start = error_rad[response.starts][:, None]
    end = error_rad[np.maximum(response.ends, 0)]
    moved = np.nan_to_num(measured)
    ahead, left = moved[..., 0, None], moved[..., 1, None]
    return np.stack([start * left, -start * ahead, end - start], axis=2)


def _value(text: str, names: Mapping[str, np.ndarray]) -> np.ndarray:
    """Value of a formula of this file or of the library, which Python and the plant read alike.

    Constants have names here, so that the forms of many constants are one text.
    """
    return eval(_compiled(text), {"__builtins__": {}, **FUNCTIONS}, dict(names)) * 1.0


@cache
def _compiled(text: str) -> CodeType:
    return compile(text.translate(NAMES), text, "eval")


def sized(forms: Sequence[Form], motion: Motion) -> list[Form]:
    """Forms with the sizes of their values over all logs; without those that are always zero."""
    found = []
    every = 1 + len(motion.velocity) // MOST_POINTS
    some = [slice(p.start, p.stop, every) for p in motion.parts]
    for form in forms:
        known = motion.values(form)
        values = np.abs(np.concatenate([known[:, p] for p in some], axis=1))
        rms = np.sqrt(np.einsum("kn,kn->k", values, values) / values.shape[1])
        sizes = np.maximum(large(values), rms)
        if np.isfinite(sizes).all() and (sizes > 1e-9).all():
            found.append(replace(form, sizes=tuple(float(s) for s in sizes)))
    return found


def large(values: np.ndarray) -> np.ndarray:
    """(k,) what 95 % of (k, N) values are below: NumPy's percentile takes five times as long."""
    last = values.shape[1] - 1
    place = 0.95 * last
    below, above = int(place), min(int(place) + 1, last)
    ordered = np.partition(values, [below, above], axis=1)
    return ordered[:, below] + (place - below) * (ordered[:, above] - ordered[:, below])


def from_library(terms: Sequence[Term], command_unit: str) -> list[Form]:
    """The library's terms that are forms."""
    return [
        Form(
            t.adds_to,
            (t.formula,),
            t.group,
            column=k,
            sizes=(t.size,),
            command_unit=command_unit if "u" in words(t.formula) else "",
        )
        for k, t in enumerate(terms)
        if t.is_form
    ]


def own_forms(
    every: Mapping[str, np.ndarray], beat_radps: float, sideways: bool, wheels: bool
) -> list[Form]:
    """Forms beside the library's.

    Args:
        every: (N,) of all logs by the names of the motion.
        beat_radps: rate at which errors swing in time; 0 if at none.
        sideways: the robot can move to its left.
        wheels: the model has wheels.
    """
    return [
        *_of_room(every, sideways),
        *_of_time(every),
        *(_swinging(to, "t", beat_radps, SHARP) for to in (*ALL_AXES, *CHANNELS) if beat_radps),
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
        _wave(to, "t", k, span) for to in (*ALL_AXES, "omega_radps") for k in range(1, count + 1)
    ]
    at = [float(f"{first + span * k / MOMENTS:.4g}") for k in range(1, MOMENTS)]
    found += [Form("motion", (f"(t > {a:g})",), TIME) for a in at]
    found += [Form("motion", (f"(t > {a:g})*(t < {b:g})",), TIME) for a in at for b in at if a < b]
    return found


def _wave(adds_to: str, name: str, k: int, span: float) -> Form:
    """That has k half waves in what the logs span of a name of the motion."""
    return _swinging(adds_to, name, np.pi * k / span, 0.5 / k)


def _swinging(adds_to: str, name: str, rate: float, spread: float) -> Form:
    """That swings at a rate, known to a share, over time or place."""
    pair = f"cos({C}*{name})", f"sin({C}*{name})"
    group, unit = (TIME, "1/s") if name == "t" else ("place", "1/m")
    constant = float(f"{rate:.4g}")
    return Form(adds_to, pair, group, constant=constant, spread=spread, unit=unit)


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
    speeds = {
        "vx": ("vx_mps", "vx*", "abs(vx)"),
        "vy": ("vy_mps", "vy*", "abs(vy)"),
        "omega": ("omega_radps", "omega*", "abs(omega)"),
        "": ("travel", "", "sqrt(vx*vx + vy*vy)"),
    }
    for axis, (to, carrier, speed) in speeds.items():
        values = np.abs(_value(speed, every))
        if not values.any():
            continue
        group, unit = ("turning rate", "rad/s") if axis == "omega" else ("speed", "m/s")
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


def on_and_off(rate_radps: float, angle_rad: float, part: float) -> Form:
    """There while a wave of the time is high, for a part of each period."""
    angle_rad = (angle_rad + np.pi) % (2 * np.pi) - np.pi
    inside = f"sin({rate_radps:.4g}*t + {A})"
    shape = f"({inside} > {np.cos(np.pi * part):.3g})"
    return Form("motion", (shape,), TIME, figures=2, phase=angle_rad)


def joined(forms: Sequence[Form]) -> dict[str, str]:
    """Texts of the effect `equation` that has these terms, all of one place, one with states.

    A phase is a number of it, behind all shapes': each log has its own.
    """
    return _with_names(forms, [()] * len(forms))


def tunable(forms: Sequence[Form]) -> dict[str, str]:
    """Forms with all constants made numbers, each form in turn."""
    return _with_names(forms, [form.searched for form in forms])


def _with_names(forms: Sequence[Form], constants: Sequence[tuple[str, ...]]) -> dict[str, str]:
    number = sum(len(form.shapes) for form in forms)
    texts, rates = [], []
    for form, searched in zip(forms, constants, strict=True):
        names = (*searched, *("phase",) * form.recurs)
        own = {name: f"p{number + k}" for k, name in enumerate(names)}
        number += len(own)
        texts += [form.filled(text, own) for text in form.shapes]
        state = (form.state.text, form.state.second_text) if form.state else ()
        rates += [form.filled(text, own) for text in state if text]
    return _equation(forms[0].adds_to, texts, rates)


def _equation(adds_to: str, texts: Sequence[str], rates: Sequence[str]) -> dict[str, str]:
    numbers = [f"p{k}" for k in range(len(texts))]
    found = {"adds_to": adds_to, "formula": _sum(adds_to, texts, numbers)}
    return found | dict(zip(("state_rate", "second_rate"), rates, strict=False))


def summed(forms: Sequence[Form], numbers: Sequence[str]) -> str:
    """The formula of terms, all of one place, with these texts in the place of their numbers."""
    return _sum(forms[0].adds_to, [text for form in forms for text in form.texts], numbers)


def with_rates(forms: Sequence[Form], numbers: Sequence[str]) -> str:
    """As `summed`, with how its states change."""
    equation, keys = joined(forms), {"state_rate": "ds/dt", "second_rate": "dr/dt"}
    rates = [f"{of} = {equation[key]}" for key, of in keys.items() if key in equation]
    return summed(forms, numbers) + (f" with {' and '.join(rates)}" if rates else "")


def _sum(adds_to: str, texts: Sequence[str], numbers: Sequence[str]) -> str:
    """Sum of numbers times texts; of a push in the room two, along x and along y."""
    terms = [f"{number}*{text}" for number, text in zip(numbers, texts, strict=True)]
    values = [terms[0::2], terms[1::2]] if adds_to == ROOM else [terms]
    return ", ".join(" + ".join(own) for own in values).replace("+ -", "- ")


def names_in(texts: Sequence[str]) -> list[str]:
    """Names of the motion that formulas have, in the order of the motion's."""
    words = set(re.findall(r"[A-Za-z_]\w*", " ".join(texts)))
    return [n for n in NAMED if n in words]


def variable_of(forms: Sequence[Form]) -> tuple[str, str]:
    """The name on which a formula is drawn, and the one that all its terms are multiplied by.

    Of a state, time.
    """
    shapes = [text for form in forms for text in form.texts]
    last = {shape.rpartition("*")[2] for shape in shapes}
    carrier = last.pop() if len(last) == 1 else ""
    factors = [shape.removesuffix(f"*{carrier}") for shape in shapes]
    named = names_in(factors[:1])
    if carrier not in ("vx", "vy", "omega") or not named:
        carrier, named = "", names_in(shapes[:1])
    return (named[0] if named and not forms[0].state else "t"), carrier
