# SPDX-License-Identifier: Apache-2.0
"""Candidate formulas without physics names: what the velocity of a body or of a wheel may lack.

Of the body: terms in its velocity, its changes, heading, place, time and voltage. Of a wheel: terms
in its command. Each comes with how the rows of a fit change by it.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import twinmill_native as native

from twinmill.data.track import command_at
from twinmill.diagnosis.columns import Columns
from twinmill.diagnosis.families import families_of
from twinmill.diagnosis.families.family import Humps
from twinmill.diagnosis.families.of_time import PARTS
from twinmill.fitting.dependence import fading, rates
from twinmill.fitting.floor import body_velocity_at
from twinmill.fitting.opening import Opened
from twinmill.formulas.forms import MOST_POINTS, large
from twinmill.formulas.term import (
    CHANGE,
    CHANNELS,
    COUPLING,
    NO_NAMES,
    PLACE,
    SPEEDS,
    STILL,
    SWELL,
    TIME,
    TYPICAL,
    WAY,
    Term,
    displaced,
    moves,
    times,
)
from twinmill.model.parameters import effect_names, words
from twinmill.predict.datasets import errors_of

LEFT_OVER = 0.02  # share of a term's norm that must survive beside what is free
REVERSAL_S = 0.15  # how long a reversal is felt
START_S = 0.4  # the same of a start from rest, and of a rise of the speed
# Of one wheel's command, with its half `h`; in proportion to u is a wheel's gain.
OF_ALL_WHEELS = "command of the wheels"
SHAPES = ("u*abs(u)", "abs(u)", "sign(u)", "sign(u)*max(0, abs(u) - h)")


def library(
    opened: Sequence[Opened], models: Sequence[native.Model], *, forms_alone: bool = False
) -> tuple[list[Term], Columns, list[np.ndarray]]:
    """Terms, (R, T) change of the rows of all logs by each at its strength, (N, 3) velocities.

    Args:
        opened: logs over their floors.
        models: with what was found, one for each.
        forms_alone: without terms that are no form.
    """
    pairs = list(zip(opened, models, strict=True))
    velocities = [body_velocity_at(own.trajectory, m, own.response.points) for own, m in pairs]
    middles = _middles(opened) | _bends(velocities)
    values = [_named_terms(own, v, middles) for own, v in zip(opened, velocities, strict=True)]
    sizes = _sizes(values)
    if forms_alone:
        sizes = {(group, f): size for (group, f), size in sizes.items() if not words(f) & NO_NAMES}
    terms = [
        Term(_across(g, f, CHANNELS[a]), CHANNELS[a], f, s)
        for (g, f), s in sizes.items()
        for a in range(3)
    ]
    of_wheels = [t for t in _wheel_terms(opened, models[0]) if t.is_form or not forms_alone]
    others, changes = ([], None) if forms_alone else _judged_together(opened, velocities, terms)

    def pieces() -> Iterator[list[np.ndarray]]:
        for k, (own, model) in enumerate(pairs):
            body = _body_columns(own, velocities[k], values[k], sizes)
            beside = changes(k, body) if changes else []
            yield [body, *beside, _wheel_columns(own, model, of_wheels)]

    columns = Columns.beside(pieces(), sum(own.trajectory.weight.size for own in opened))
    return [*terms, *others, *of_wheels], columns, velocities


def _judged_together(
    opened: Sequence[Opened], velocities: Sequence[np.ndarray], terms: Sequence[Term]
) -> tuple[list[Term], Callable[[int, np.ndarray], list[np.ndarray]]]:
    """Terms that change all speeds alike, waves and families; makes each log's columns of them.

    Args:
        opened: logs over their floors.
        velocities: (N, 3) of the body in each.
        terms: of the body, from whose (R, T) columns some of them follow.
    """
    of_all, parts = _terms_of_all_speeds(terms)
    times_s = [own.response.middle_s for own in opened]
    ways_m = [_way_m(own, v) for own, v in zip(opened, velocities, strict=True)]
    waves = [Waves.along(times_s, TIME, "t", WAVE_S), Waves.along(ways_m, WAY, "way", WAVE_M)]
    families = families_of(opened, velocities)

    def changes(k: int, body: np.ndarray) -> list[np.ndarray]:
        own, velocity = opened[k], velocities[k]
        swells = [
            w.columns(own, velocity, along[k])
            for w, along in zip(waves, (times_s, ways_m), strict=True)
        ]
        return [body @ parts, *swells, *(f.columns(own, velocity) for f in families)]

    of_waves = (t for wave in waves for t in wave.terms)
    of_families = (t for family in families for t in family.terms)
    return [*of_all, *of_waves, *of_families], changes


def _across(group: str, formula: str, to: str) -> str:
    """The group, or of a speed whose size moves another axis that speed."""
    if group != "direction of rotation" or CHANNELS[SPEEDS.index(formula[4:-1])] == to:
        return group
    return "turning rate" if formula == "abs(omega)" else "speed"


def norms(columns: np.ndarray) -> np.ndarray:
    """(T,) lengths of (R, T) columns, which are too large for another array of their squares."""
    return np.sqrt(np.einsum("rt,rt->t", columns, columns))


def _terms_of_all_speeds(terms: Sequence[Term]) -> tuple[list[Term], np.ndarray]:
    """Terms in time that change all speeds alike, and (T, n) their parts among the body's terms."""
    carriers = dict(zip(CHANNELS, SPEEDS, strict=True))
    found: dict[str, dict[int, Term]] = {}
    for k, term in enumerate(terms):
        factor, _, carrier = term.formula.rpartition("*")
        if term.group == TIME and carrier == carriers[term.adds_to]:
            found.setdefault(factor, {})[k] = term
    parts, of_all = np.zeros((len(terms), len(found))), []
    for n, (factor, own) in enumerate(found.items()):
        size = max(t.size for t in own.values() if t.adds_to != CHANNELS[2])
        of_all.append(Term(TIME, "rim_mps", f"{factor}*rim", size))
        for k, term in own.items():
            parts[k, n] = of_all[-1].strength / term.strength
    return of_all, parts


WAVE_S = 6.0  # the shortest
WAVE_M = 1.5  # the same of way driven
MOST_WAVES = 20


@dataclass(frozen=True)
class Waves:
    """Changes of all speeds alike, or of one, that come and go with time or way.

    Attributes:
        terms: pairs, cosine and sine, of all speeds and of each.
        rates: (n,) of the pairs, 1/s or 1/m.
    """

    terms: list[Term]
    rates: np.ndarray

    @staticmethod
    def along(every: Sequence[np.ndarray], group: str, name: str, shortest: float) -> "Waves":
        """Over what all logs span."""
        longest = 1.1 * np.ptp(np.concatenate(every))
        count = int(np.clip(longest / shortest, 0, MOST_WAVES))
        rates = np.array([float(f"{2 * np.pi * k / longest:.4g}") for k in range(1, 1 + count)])
        quick = np.pi / shortest
        terms = [
            Term(
                group,
                to,
                f"{wave}({rate:g}*{name})*{speed}",
                TYPICAL[to] / SWELL,
                f"{speed} swells {'quickly' if rate > quick else 'slowly'}",
            )
            for to, speed in zip(("rim_mps", *CHANNELS), ("rim", *SPEEDS), strict=True)
            for rate in rates
            for wave in ("cos", "sin")
        ]
        return Waves(terms, rates)

    def columns(self, own: Opened, velocity: np.ndarray, along: np.ndarray) -> np.ndarray:
        """(R, 8 n) change of a log's rows, as (N, 3) `velocity` moves the robot."""
        angle = along[:, None] * self.rates
        gains = SWELL * np.stack([np.cos(angle), np.sin(angle)], axis=-1).reshape(len(angle), -1)
        response = own.response
        parts = [displaced(response, velocity, velocity[:, [k]] * gains, k) for k in range(3)]
        weight = np.nan_to_num(own.trajectory.weight)[..., None]
        columns = [part * weight for part in (sum(parts), *parts)]
        return np.concatenate(columns, axis=-1).reshape(weight.size, len(self.terms))


def _way_m(own: Opened, velocity: np.ndarray) -> np.ndarray:
    """(N,) driven since the log's begin, at (N, 3) `velocity`."""
    return np.cumsum(np.hypot(velocity[:, 0], velocity[:, 1]) * own.response.step_s)


def _sizes(values: list[dict[tuple[str, str], np.ndarray]]) -> dict[tuple[str, str], float]:
    """One size of each term for all logs."""
    sizes: dict[tuple[str, str], float] = {}
    step = 1 + sum(len(next(iter(v.values()))) for v in values) // MOST_POINTS
    for key in [k for k in values[0] if all(k in v for v in values)]:
        every = np.concatenate([v[key][::step] for v in values])
        # What all but the largest are below; of rare ones, which that would call nothing, the RMS.
        high = float(large(np.abs(every)[None])[0])
        sizes[key] = max(high, float(np.sqrt(np.mean(every**2))), 1e-9)
    return sizes


BENDS = (0.3, 0.6, 0.85)  # quantiles of a speed at which its curve may bend


def _bends(velocities: Sequence[np.ndarray]) -> dict[str, float]:
    """Speeds over all logs at which curves may bend: `vx0` to `omega2`, to three digits."""
    found: dict[str, float] = {}
    for name, still, speed in zip(SPEEDS, STILL, np.abs(np.concatenate(velocities)).T, strict=True):
        if (speed > still).any():
            bends = np.quantile(speed[speed > still], BENDS)
            found |= {f"{name}{k}": float(f"{b:.3g}") for k, b in enumerate(bends)}
    return found


def _middles(opened: Sequence[Opened]) -> dict[str, float]:
    """Middle of place, time and voltage over all logs, to four digits, as a formula has them.

    And moments at which something may have changed for good, `t0` to `t4`.
    """
    parts: dict[str, list[np.ndarray]] = {"x": [], "y": [], "t": [], "V": []}
    for own in opened:
        response = own.response
        parts["x"].append(response.pose[:, 0])
        parts["y"].append(response.pose[:, 1])
        parts["t"].append(response.middle_s)
        parts["V"].append(np.nan_to_num(own.track.battery_V))
    every = {name: np.concatenate(p) for name, p in parts.items()}
    found = {name: np.mean(values) for name, values in every.items()}
    found |= {f"t{k}": np.quantile(every["t"], part) for k, part in enumerate(PARTS)}
    return {name: float(f"{value:.4g}") for name, value in found.items()}


def _body_columns(
    own: Opened,
    velocity: np.ndarray,
    terms: dict[tuple[str, str], np.ndarray],
    sizes: dict[tuple[str, str], float],
) -> np.ndarray:
    """(R, 3 T) change of the rows by each term in each body axis, at (N, 3) `velocity`."""
    response = own.response
    values = np.stack([terms[key] / sizes[key] for key in sizes], axis=-1)
    weight = np.nan_to_num(own.trajectory.weight)
    columns = np.empty((*weight.shape, len(sizes), 3))
    for axis, channel in enumerate(CHANNELS):
        change = displaced(response, velocity, TYPICAL[channel] * values, axis)  # (W, H, 3, T)
        np.multiply(change, weight[..., None], out=columns[..., axis])
    return columns.reshape(weight.size, -1)


def _wheel_terms(opened: Sequence[Opened], model: native.Model) -> list[Term]:
    """Terms for each wheel that has a command of its own, and for all at some commands."""
    if model.drive not in ("duty", "wheel_speed"):
        return []
    command = np.abs(np.concatenate([own.track.command for own in opened]))
    largest = float(np.percentile(command, 95))
    if largest <= 0:
        return []
    sides = {}
    for wheel in model.wheels():
        side, named = f"left {_sign(wheel['y_m'])}", wheel["words"]
        if model.wheel_kind == "differential":  # both wheels of a side have one command
            named = f"{'left' if wheel['y_m'] > 0 else 'right'} wheels"
        else:
            side += f" && front {_sign(wheel['x_m'])}"
        sides[side] = f"command of the {named}"
    half = f"{largest / 2:.4g}"
    sizes = (largest**2, largest, 1.0, largest / 2)
    table = model.drive == "duty"  # which has the speed at each duty
    humps = [] if table else Humps.over(0.0, largest).texts("abs(u)")
    return [
        Term(group, "rim_mps", f"({side} ? {shape.replace('h', half)} : 0)", size)
        for side, group in sides.items()
        for shape, size in zip(SHAPES, sizes, strict=True)
    ] + [Term(OF_ALL_WHEELS, "rim_mps", f"sign(u)*{h}", 1.0, "at some u") for h in humps]


def _sign(place_m: float) -> str:
    return "> 0" if place_m > 1e-9 else "< 0" if place_m < -1e-9 else "== 0"


def _wheel_columns(own: Opened, model: native.Model, terms: Sequence[Term]) -> np.ndarray:
    """(R, T) change of the rows by each term of a wheel, by the plant itself."""
    before = errors_of(own.trajectory, model)
    columns = np.zeros((len(before), len(terms)))
    for k, term in enumerate(terms):
        with_it = model.copy()
        texts = {"adds_to": term.adds_to, "formula": f"p0*{term.formula}"}
        with_it.add_effect("equation", texts)
        name = f"{effect_names(with_it)[-1]}.p0"
        (after,) = own.trajectory.rows(with_it, [name], np.array([[term.strength]]))
        columns[:, k] = before - after
    return columns


def _named_terms(
    own: Opened, velocity: np.ndarray, middles: Mapping[str, float]
) -> dict[tuple[str, str], np.ndarray]:
    """(group, formula) to values (N,) at the response's points, of (N, 3) `velocity` there."""
    response, track = own.response, own.track
    velocity = np.where(np.abs(velocity) < STILL, 0.0, velocity)
    vx, vy, turn = velocity.T
    theta, t_s = response.heading_rad, response.middle_s
    x, y = response.pose[:, 0], response.pose[:, 1]
    voltage = command_at(t_s, track.command_t_s, np.nan_to_num(track.battery_V)[:, None])[:, 0]
    moving = moves(velocity) * 1.0
    change = rates(np.column_stack([vx, vy, turn]), response.step_s).T
    terms = {
        ("direction of rotation", "abs(vx)"): np.abs(vx),
        ("direction of rotation", "abs(vy)"): np.abs(vy),
        ("direction of rotation", "abs(omega)"): np.abs(turn),
        ("speed", "vx*abs(vx)"): vx * np.abs(vx),
        ("speed", "vy*abs(vy)"): vy * np.abs(vy),
        ("turning rate", "omega*abs(omega)"): turn * np.abs(turn),
        ("speed", "sign(vx)"): np.tanh(vx / 0.02),
        ("speed", "sign(vy)"): np.tanh(vy / 0.02),
        ("turning rate", "sign(omega)"): np.tanh(turn / 0.1),
        (COUPLING, "vx*omega"): vx * turn,
        (COUPLING, "vy*omega"): vy * turn,
        (COUPLING, "vx*vy"): vx * vy,
        (COUPLING, "vx*abs(omega)"): vx * np.abs(turn),
        (COUPLING, "vx*abs(vy)"): vx * np.abs(vy),
        (COUPLING, "vy*abs(vx)"): vy * np.abs(vx),
        (COUPLING, "vy*abs(omega)"): vy * np.abs(turn),
        (COUPLING, "omega*abs(vx)"): turn * np.abs(vx),
        (COUPLING, "omega*abs(vy)"): turn * np.abs(vy),
        (CHANGE, "dvx"): change[0],
        (CHANGE, "dvy"): change[1],
        (CHANGE, "domega"): change[2],
        (CHANGE, "abs(dvx)"): np.abs(change[0]),
        (CHANGE, "abs(dvy)"): np.abs(change[1]),
        (CHANGE, "abs(domega)"): np.abs(change[2]),
    }
    speeds = (("vx", vx), ("vy", vy), ("omega", turn))
    for name, values in speeds:
        term = _after_reversal(values, t_s)
        if term.any():
            terms["reversals", f"after_reversal({name})"] = term
        terms[CHANGE, f"after_rise({name})"] = _after_rise(values, response.step_s)
        terms["starts", f"after_start({name})"] = values * _since_start(moving, t_s)
        bends = [middles[f"{name}{k}"] for k in range(len(BENDS)) if f"{name}{k}" in middles]
        for bend in bends:
            above = np.maximum(np.abs(values) - bend, 0.0) * np.sign(values)
            group = "turning rate" if name == "omega" else "speed"
            terms[group, f"sign({name})*max(0, abs({name}) - {bend:g})"] = above
    terms["starts", "after_start(moves)"] = moving * _since_start(moving, t_s)
    if np.ptp(theta) > 0.1:
        for n in (1, 2, 3, 4):
            for name, wave in (("cos", np.cos(n * theta)), ("sin", np.sin(n * theta))):
                for carrier, values in (("moves", moving), *speeds):
                    terms["heading", f"{name}({times(n, 'theta')})*{carrier}"] = wave * values
    for group, name, values in (
        (PLACE, "x", x), (PLACE, "y", y), (TIME, "t", t_s), ("battery voltage", "V", voltage)
    ):  # fmt: skip
        if np.ptp(values) <= 0:
            continue
        away = values - middles[name]
        text = f"({name} - {middles[name]:g})"
        for carrier, speed in speeds:
            terms[group, f"{text}*{carrier}"] = away * speed
            if group == PLACE:
                terms[group, f"{text}*{text}*{carrier}"] = away**2 * speed
        if group == PLACE:
            for wave, part in (("cos", np.cos(theta)), ("sin", np.sin(theta))):
                terms[group, f"{text}*{wave}(theta)*moves"] = away * part * moving
    if np.ptp(t_s) > 0:
        for (carrier, _), rate in zip(speeds, change, strict=True):
            terms[TIME, f"(t - {middles['t']:g})*d{carrier}"] = (t_s - middles["t"]) * rate
    for at_s in (middles[f"t{k}"] for k in range(len(PARTS))):
        for carrier, speed in speeds:
            terms[TIME, f"sign(t - {at_s:g})*{carrier}"] = np.sign(t_s - at_s) * speed
    return terms


def _after_rise(speed: np.ndarray, step_s: np.ndarray) -> np.ndarray:
    """By how much a speed rose lately, fading with the time since; its sign is the speed's."""
    rise = np.maximum(np.diff(np.abs(speed), prepend=np.abs(speed[0])), 0.0) * np.sign(speed)
    return fading(rise, START_S, step_s)


def _since_start(moving: np.ndarray, t_s: np.ndarray) -> np.ndarray:
    """1 where the robot starts from rest, fading with the time since."""
    starts = np.flatnonzero((moving > 0) & (np.r_[1.0, moving[:-1]] == 0))
    last = np.searchsorted(starts, np.arange(len(t_s)), side="right") - 1
    if not len(starts):
        return np.zeros(len(t_s))
    since_s = t_s - t_s[starts[np.maximum(last, 0)]]
    return np.where(last >= 0, np.exp(-since_s / START_S), 0.0)


def _after_reversal(speed: np.ndarray, t_s: np.ndarray) -> np.ndarray:
    """Direction of a motion that was turned round, fading with the time since; 0 before any."""
    place = np.arange(len(speed))
    last = np.maximum.accumulate(np.where(speed != 0, place, 0))
    sign = np.sign(speed[last])
    turned = np.concatenate([[False], (sign[1:] * sign[:-1]) < 0])
    since_s = t_s - t_s[np.maximum.accumulate(np.where(turned, place, 0))]
    begun = np.cumsum(turned) > 0
    return np.where(begun, sign * np.exp(-since_s / REVERSAL_S), 0.0)
