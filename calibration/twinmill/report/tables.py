# SPDX-License-Identifier: Apache-2.0
"""The tables that a person reads, as plain data: the terminal and the HTML report show the same."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from twinmill.data.measurement import Measurement
from twinmill.data.units import date_of
from twinmill.estimation.opened import NoiseFloor
from twinmill.fitting.add import AddResult
from twinmill.fitting.compare import GOOD, MISSING, Comparison, RobotComparison
from twinmill.fitting.fit import Held
from twinmill.model.parameters import NORMAL_95, ParameterEstimate
from twinmill.predict.noise import LEAST, Noise
from twinmill.predict.regimes import HORIZON, Regime
from twinmill.predict.windows import CHANNELS, HORIZONS_S, rms

Tone = Literal["", "good", "warn", "bad", "dim"]
VERDICTS: dict[str, Tone] = {
    "cannot_tell": "warn",
    "bad_input": "bad",
    "model_adequate": "good",
    "refit_enough": "warn",
    "effect_missing": "bad",
    "ambiguous": "warn",
    "outside_catalogue": "bad",
}

SHOWN = {
    "m": (1000.0, "mm"),
    "rad": (float(np.degrees(1)), "°"),
}  # unit: factor, as a person reads it
# Times the least noise that a fit assumes, which a log without any shares among sensor and drive.
UNSEEN = 2
WORST = 3  # regimes of a group
NOT_WHITE = 0.02  # p-value: no draw of 64 remembers as much
TOGETHER = (
    "Known only in combination: the log determines how such quantities go together (the "
    "covariance in the model file), as that one side is weaker, but none of them by itself."
)


@dataclass(frozen=True)
class Cell:
    """One cell: text, what colour it deserves, and a bar of this share of the column (or None)."""

    text: str
    tone: Tone = ""
    bar: float | None = None


@dataclass(frozen=True)
class Table:
    """A table; a note goes below. By their places, columns of `words` stand left and may wrap.

    Those of them in `lists` are entries with commas between.
    """

    title: str
    columns: list[str]
    rows: list[list[Cell]]
    note: str = ""
    words: tuple[int, ...] = (0,)
    lists: tuple[int, ...] = ()


def number(value: float | None, significant: int = 3) -> str:
    """That many significant digits, without an exponent where a person would write none."""
    if value is None or not np.isfinite(value):
        return "-"
    if value == 0 or 1e-4 <= abs(value) < 1e6:
        power = int(f"{value:.{significant - 1}e}".partition("e")[2])
        return f"{value:.{max(0, significant - 1 - power)}f}"
    return f"{value:.{significant - 1}e}"


def tone(score: float) -> Tone:
    """Colour of a score or of a ratio."""
    if not np.isfinite(score):
        return "dim"
    return "good" if score <= GOOD else "warn" if score <= MISSING else "bad"


def facts(comparison: Comparison, robot: RobotComparison) -> list[tuple[str, str]]:
    """Log and model of a comparison: label and text.

    Args:
        comparison: of one robot or more.
        robot: the one that is shown.
    """
    measurement, noise = robot.measurement, robot.modelled.known_noise
    track = measurement.track
    others = len(comparison.robots) - 1
    why = "which the model misses most" if comparison.about is None else "which it was added to"
    return [
        (
            "log",
            f"{measurement.log_name}, robot {track.robot_id}"
            + (f", {why} (and {others} more)" if others else ""),
        ),
        (
            "recorded",
            f"{_date(measurement)}, {track.pose_t_s[-1] - track.pose_t_s[0]:.0f} s, "
            f"{len(track.pose)} poses used, driven by {track.command_kind.replace('_', ' ')}",
        ),
        ("model", comparison.model_name),
        ("noise", _noise(noise, track.has_heading, wrong=robot.score > GOOD)),
        ("noise floor", robot.floor.reason or _floor(robot.floor)),
        *_whiteness(robot.whiteness),
        ("clocks", _clocks(robot)),
        *_held_heading(robot),
        *_wheel_angles(robot),
        *_phases(robot),
    ]


def _date(measurement: Measurement) -> str:
    """Date of a recording; the twin's own start is a fixed one, the same in every run."""
    if measurement.simulated:
        return "simulated"
    recorded = date_of(measurement.recorded_utime_us)
    return f"{recorded:%Y-%m-%d %H:%M} UTC" if recorded else "date unknown"


def _clocks(robot: RobotComparison) -> str:
    """Offset between the clocks of poses and commands, with its sign in words."""
    if robot.measurement.same_clock and not robot.time_offset_s:
        return "one clock stamped poses and commands"
    side = "later" if robot.time_offset_s >= 0 else "earlier"
    return (
        f"motion capture's stamps are {number(1000 * abs(robot.time_offset_s))} ms {side} "
        "than the robot's of the same moment; a constant delay of the robot is included"
    )


def _held_heading(robot: RobotComparison) -> list[tuple[str, str]]:
    """Heading that the robot seems to hold, where none was recorded."""
    if robot.held_heading_rad is None:
        return []
    angle_deg = np.degrees(robot.held_heading_rad)
    said = f"not recorded; held at {angle_deg:.0f}°, where the motion fits the commands best"
    return [("heading", said)]


def _wheel_angles(robot: RobotComparison) -> list[tuple[str, str]]:
    """Angle of each wheel at the start of the log, where that matters to the model."""
    if robot.wheel_angles_rad is None:
        return []
    angles = ", ".join(f"{w} {round(np.degrees(a))}°" for w, a in robot.wheel_angles_rad.items())
    said = f"not recorded; the log begins at {angles}, where the model fits best"
    return [("wheel angles", said)]


def _phases(robot: RobotComparison) -> list[tuple[str, str]]:
    """Phase of each periodic formula at the start of the log."""
    if not robot.phases:
        return []
    told = [
        f"{p.name} {round(np.degrees(np.angle(np.exp(1j * p.value))))}° "
        + (
            f"± {max(1, round(np.degrees(NORMAL_95 * p.std)))}°"
            if p.seen
            else "(poorly determined)"
        )
        for p in robot.phases
    ]
    return [("phases", f"the log begins at {', '.join(told)}, where the model fits best")]


def _noise(noise: Noise, has_heading: bool, *, wrong: bool) -> str:
    """Standard deviations of the poses and of the robot's speed, in words.

    No larger than fits assume at least is none. While the model is wrong its error is in what seems
    to be noise of the speed.
    """
    channels = [
        ("speed", noise.position, 1000.0, " mm"),
        ("turn rate", noise.heading, float(np.degrees(1)), "°"),
    ]
    poses, moves = [], []
    for (name, at, shown, unit), least in zip(channels[: 1 + has_heading], LEAST, strict=False):
        if at.sensor > UNSEEN * least[0]:
            poses.append(f"{number(shown * at.sensor, 2)}{unit}")
        if at.drive > UNSEEN * least[1]:
            memory = f"correlation time {number(at.memory_s, 2)} s"
            moves.append(f"{name} {number(shown * at.drive, 2)}{unit}/s ({memory})")
    of = "poses" if has_heading else "positions"
    told = [f"{of} {' and '.join(poses)}"] if poses else []
    told += [", ".join(moves)] if moves else []
    of_model = "; those of speed and turn rate include the model's error" if moves and wrong else ""
    return f"{'; '.join(told)}{of_model}" if told else "none found"


def _floor(floor: NoiseFloor) -> str:
    """Where a floor comes from, and between which scores right models are."""
    low, high = floor.by_chance
    of_best = "error by the noise of the best model found, as diagnose searches for it"
    return f"{of_best}; 95 of 100 right models score {low:.2f} to {high:.2f} in such a log"


def _whiteness(p_value: float) -> list[tuple[str, str]]:
    """Result of the test of whiteness, in words; none where the log gives no floor."""
    if np.isnan(p_value):
        return []
    tested = f"(correlations of errors against those in draws of the noise: p = {p_value:.2f})"
    if p_value < NOT_WHITE:
        return [("residuals", f"not white {tested}: the noise alone does not explain them")]
    return [("residuals", f"white {tested}: what the model leaves looks like noise")]


def robots(result: Comparison, before: Comparison | None = None) -> list[Table]:
    """Score of each of several robots, worst first; before a fit as well, if that is given."""
    if len(result.robots) == 1:
        return []
    old = [r.score for r in before.robots] if before else []
    order = sorted(range(len(result.robots)), key=lambda k: -np.nan_to_num(result.robots[k].score))
    rows = [
        [
            Cell(result.robots[k].measurement.label),
            *(
                Cell(number(score), tone(score))
                for score in (*old[k : k + 1], result.robots[k].score)
            ),
        ]
        for k in order
    ]
    columns = ["robot", "before", "after"] if before else ["robot", "score"]
    return [Table("Each robot", columns, rows)]


def errors(robot: RobotComparison) -> Table:
    """Errors by horizon and channel, each with its noise floor."""
    found, floor = rms(robot.errors), robot.floor.rms
    columns = ["horizon\ns"]
    for channel, unit in CHANNELS:
        columns += [f"{channel}\n{SHOWN[unit][1]}", "noise\nfloor", "ratio"]
    rows = []
    for h, horizon_s in enumerate(HORIZONS_S):
        row = [Cell(f"{horizon_s:g}")]
        for c, (_, unit) in enumerate(CHANNELS):
            ratio = found[h, c] / floor[h, c]
            row += [
                Cell(number(found[h, c] * SHOWN[unit][0])),
                Cell(number(floor[h, c] * SHOWN[unit][0]), "dim"),
                Cell(number(ratio), tone(max(ratio, 1.0))),
            ]
        rows.append(row)
    return Table(
        "Prediction errors",
        columns,
        rows,
        "RMS error of predictions that start from measured poses; noise floor: one standard "
        "deviation of what noise alone causes; ratio: error over noise floor.",
    )


def where(robot: RobotComparison) -> Table:
    """The worst regimes of each group."""
    groups: dict[str, list[Regime]] = {}
    for regime in robot.where:
        groups.setdefault(regime.group, []).append(regime)
    worst = max((r.ratio for r in robot.where), default=1.0)
    rows = []
    for group, regimes in groups.items():
        for i, r in enumerate(regimes[:WORST]):
            rows.append(
                [
                    Cell("" if i else group, "dim"),
                    Cell(r.regime),
                    Cell(number(r.ratio), tone(max(r.ratio, 1.0)), r.ratio / worst),
                    Cell(f"{100 * r.share:.0f} %"),
                ]
            )
    return Table(
        "Where it fails",
        ["by", "while", "error over noise floor", "share of error"],
        rows,
        f"Horizon of {HORIZONS_S[HORIZON]:g} s; the {WORST} worst of each kind. Each kind sorts "
        "the same squared error anew: its shares, with those not listed, are 100 % at most.",
        (0, 1),
    )


def doubt_of(e: ParameterEstimate) -> str:
    """Why an estimate is not just what the log tells; empty if it is."""
    if e.at_bound:
        return "at its bound"
    if not e.told:
        return "from the prior" if e.prior else "not determined by this log"
    return "" if e.seen else "known only in combination"


def parameters(estimates: list[ParameterEstimate], held: Sequence[Held] = ()) -> Table:
    """Fitted quantities with their uncertainty, then those that were held."""
    rows = []
    for e in estimates:
        told = e.told or e.prior
        doubt = doubt_of(e)
        remark = "; ".join(words for words in (e.words, doubt) if words)
        value, std = (
            (rounded(e.value, e.std), f"± {number(e.std)}") if told else (number(e.value), "-")
        )
        rows.append(
            [
                Cell(e.name, "" if told else "dim"),
                Cell(value, "" if told else "dim"),
                Cell(std),
                Cell(e.of_unit.strip()),
                Cell(remark, "warn" if doubt else "dim"),
            ]
        )
    for h in held:
        remark = "; ".join(words for words in (h.words, "held") if words)
        cells = (h.name, number(h.value), "-", of_unit(h.unit), remark)
        rows.append([Cell(text, "dim") for text in cells])
    together = any(e.together for e in estimates)
    return Table(
        "Fitted quantities",
        ["quantity", "value", "std", "unit", ""],
        rows,
        TOGETHER if together else "",
        words=(0, 3, 4),
    )


def of_unit(unit: str) -> str:
    """A unit for people; nothing for a pure number."""
    return "" if unit == "1" else unit.replace("^2", "²")


def percent(probability: float) -> str:
    """A probability in percent; none is certain."""
    if probability > 0.99:
        return f"{min(100 * probability, 99.9):.1f} %"
    return f"{100 * probability:.0f} %" if probability >= 0.01 else "< 1 %"


def estimate(e: ParameterEstimate) -> str:
    """In a line: `deceleration_mps2 0.70 ± 0.02 m/s²`."""
    spread = f" ± {e.std:.1g}" if np.isfinite(e.std) else ""
    return f"{e.short} {rounded(e.value, e.std)}{spread}{e.of_unit}"


def rounded(value: float, std: float) -> str:
    """To the digits that the uncertainty leaves meaning."""
    if not np.isfinite(std) or std <= 0:
        return number(value)
    return f"{value:.{int(np.clip(1 - np.floor(np.log10(std)), 0, 6))}f}"


def held_out(added: AddResult) -> list[Table]:
    """Cross-validated errors, before and after; none without a log."""
    if not added.heldout_after.rows():
        return []
    columns = ["horizon\ns"]
    for channel, unit in CHANNELS:
        columns += [f"{channel}\n{SHOWN[unit][1]}", "after"]
    rows = []
    for h, horizon_s in enumerate(HORIZONS_S):
        row = [Cell(f"{horizon_s:g}")]
        for c, (_, unit) in enumerate(CHANNELS):
            before, after = added.heldout_before.rms[h, c], added.heldout_after.rms[h, c]
            row += [
                Cell(number(before * SHOWN[unit][0])),
                Cell(
                    number(after * SHOWN[unit][0]),
                    "good" if after < 0.95 * before else "bad" if after > 1.05 * before else "",
                ),
            ]
        rows.append(row)
    note = (
        "Six-fold cross-validation: each part of the log is predicted by a fit to the other five."
    )
    return [Table("Errors on held-out data", columns, rows, note)]


def catalogue(entries: list[dict[str, Any]]) -> Table:
    """The effects in the order of the signal path."""
    order = ("duty", "wheel", "ground", "world", "observe", "view", "decide")
    ranked = sorted(entries, key=lambda e: order.index(e["stage"]))
    rows = [[Cell(e["name"]), Cell(e["stage"]), Cell(e["summary"])] for e in ranked]
    return Table(
        "Effects",
        ["effect", "stage", "what it is"],
        rows,
        "twinmill twin effects NAME shows one with its equation and parameters.",
        (0, 1, 2),
    )


def effect_texts(entry: dict[str, Any]) -> Table:
    """Texts that an effect of the user's own is made of."""
    rows = [[Cell(t["name"]), Cell(t["default"]), Cell(t["doc"])] for t in entry["texts"]]
    return Table("Texts", ["text", "default", "meaning"], rows, words=(0, 1, 2))


def effect_parameters(entry: dict[str, Any]) -> Table:
    """Parameters of an effect's card: unit, default, bounds and meaning."""
    rows = [
        [
            Cell(p["name"]),
            *(Cell(f"{p[key]:g}") for key in ("default", "min", "max", "neutral")),
            Cell("" if p["unit"] == "1" else p["unit"]),
            Cell(p["doc"]),
        ]
        for p in entry["parameters"]
    ]
    return Table(
        "Parameters",
        ["parameter", "default", "min", "max", "neutral", "unit", "meaning"],
        rows,
        words=(0, 5, 6),
    )
