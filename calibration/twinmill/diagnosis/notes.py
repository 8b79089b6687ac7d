# SPDX-License-Identifier: Apache-2.0
"""Notes on logs and a fitted base beside effects: stamps, wheel geometry, irregular motion."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import twinmill_native as native

from twinmill.diagnosis.finding import Finding
from twinmill.diagnosis.moments import held, left_out
from twinmill.diagnosis.settings import SETTINGS
from twinmill.fitting.compare import Comparison
from twinmill.fitting.floor import overlapping
from twinmill.fitting.opening import Opened, of_few_commands
from twinmill.listing import listed
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import HEADING, drives_sideways
from twinmill.predict.datasets import ErrorDataset, Trajectory
from twinmill.predict.modelled_log import ModelledLog
from twinmill.predict.noise import MEMORY_S, ChannelNoise, Noise
from twinmill.predict.windows import HORIZONS_S, rms

MOST_TOLD = 3  # stretches
WHILE = "transient_loss"  # for a while
NOTABLE = 0.01  # change of a gain that is worth a sentence
HARDLY_LONGER = 0.95  # of the longest memory that a fit of noise finds: it may be longer
LEAST_DRIVE = (2e-3, 2e-2)  # m/s, rad/s: no robot follows more regularly


def time_base_notes(logs: list[ModelledLog]) -> list[str]:
    """A sentence if logs do not last as long as they say."""
    bases = [s.measurement.time_base for s in logs if s.measurement.time_base]
    if not bases:
        return []
    straight, turning = (np.array([getattr(b, k) for b in bases]) for k in ("straight", "turning"))
    return [
        "clock_rate: the stamps of the wheel speeds are not times. A second of them lasts "
        f"{straight.mean():.3f} s on straights ({straight.min():.3f} to {straight.max():.3f} over "
        f"{len(bases)} logs) and {turning.mean():.3f} s in turns ({turning.min():.3f} to "
        f"{turning.max():.3f}); this was put right before anything else."
    ]


def missed_notes(before: Comparison) -> list[str]:
    """Which of several runs of one robot the model as given misses, where it predicts others."""
    if len({r.robot_id for r in before.robots}) > 1 or not before.missed:
        return []
    named = listed([f"{r.measurement.log_name} (score {r.score:.2f})" for r in before.missed])
    return [f"The model as given misses {named}, and predicts the other logs of this robot."]


def geometry_notes(model: native.Model) -> list[str]:
    """Sentences on what gains mean where wheel speeds are measured: rolling and lever."""
    if model.drive != "wheel_speed":
        return []
    forward, sideways, yaw = (model.get(f"base.{k}_gain") for k in ("forward", "sideways", "yaw"))
    notes = []
    if drives_sideways(model) and abs(1 - sideways / forward) > NOTABLE:
        more = "less far" if sideways < forward else "farther"
        notes.append(
            f"Sideways the robot rolls {100 * abs(1 - sideways / forward):.1f} % {more} than "
            f"forward at the same wheel speeds (gains {sideways:.3f} and {forward:.3f})."
        )
    if abs(1 - yaw) > NOTABLE:
        notes.append(
            f"It turns as if its wheels stood {1 / yaw:.3f} times as far from the middle as the "
            "model says."
        )
    return notes


def scatters_of(
    opened: Sequence[Opened], noises: Sequence[Noise | None], model_file: ModelFile
) -> list[float]:
    """How many times less regular each log is than the model's noise says; 0 where none is known.

    Args:
        opened: logs over their floors, with what was found in them; tables have no noise.
        noises: that each shows.
        model_file: what it states of the disturbance was told by another log.
    """
    model, known_mps = model_file.model, model_file.noise_speed_mps
    if model.get("noise.drive_mps") <= 0:
        return [0.0] * len(opened)
    return [
        irregularity(_no_more_than_left(own), noise, model, known_mps)
        if noise and own.data
        else 0.0
        for own, noise in zip(opened, noises, strict=True)
    ]


def _no_more_than_left(own: Opened) -> Opened:
    """Measurement over a floor that is nowhere above the errors that its model leaves.

    The smooth response is the same all the time: a loss for a while, or a slew, it cannot follow,
    and has it for noise. What a model explains is none, nor what reaches into a stretch that is
    left out.
    """
    seen, floor = own.trajectory.keep, own.known_floor
    if not seen.all():
        seen = seen & ~overlapping(own.trajectory, ~seen)
    left = np.where(seen[:, None, None], own.trajectory.errors(own.model), np.nan)
    return replace(own, floor=replace(floor, rms=np.fmin(floor.rms, rms(left))))


def is_random(scatters: Sequence[float], score: float) -> bool:
    """True if randomness is there that was not when the model's noise was told.

    Args:
        scatters: of each log, as `scatters_of` has them.
        score: of the model with what was found; where it leaves nothing, more must scatter.
    """
    alone = score <= SETTINGS.level
    return max(scatters) > (SETTINGS.random_alone if alone else SETTINGS.random)


def random_in_words(
    scatters: Sequence[float], noises: Sequence[Noise | None], model: native.Model
) -> str:
    """By how much, and for how long, the least regular log is disturbed; empty if that is not told.

    Args:
        scatters: of each log, as `scatters_of` has them.
        noises: that each shows.
        model: that states another noise.
    """
    noise = noises[int(np.argmax(scatters))]
    if noise is None:
        return ""
    told = []
    for own, key, unit in (
        (noise.position, "drive_mps", "m/s"),
        (noise.heading, "drive_radps", "rad/s"),
    ):
        if own.drive > SETTINGS.irregular * model.get(f"noise.{key}"):
            more = " or more" if own.memory_s > HARDLY_LONGER * MEMORY_S[1] else ""
            told.append(f"{own.drive:.2g} {unit} for {own.memory_s:.1g} s{more}")
    return f"by about {' and '.join(told)} at a time" if told else ""


def irregularity_notes(opened: Sequence[Opened], scatters: Sequence[float]) -> list[str]:
    """A sentence for each log that is far less regular than the model's noise says.

    The floor of a log is what no smooth response to its commands follows. Where it is far above the
    disturbance that the model file states, and what was found leaves no less, something is there
    that such a response cannot follow either: play, joints between tiles, drop-outs, or more noise.
    """
    return [
        f"{own.measurement.label}: the unexplained scatter is {scatter:.1f} times the noise in "
        "the model file (more random disturbance, slipping wheels, play in the gears or a rough "
        "floor may be)."
        for own, scatter in zip(opened, scatters, strict=True)
        if scatter > SETTINGS.irregular
    ]


def disturbed_notes(opened: Sequence[Opened]) -> list[str]:
    """A sentence for each log of which something is judged nowhere, as a push would be."""
    notes = []
    for own in opened:
        told = [s.words for s in left_out(own)] if own.floor and own.data is not None else []
        if told:
            more = f" and {len(told) - MOST_TOLD} more" if len(told) > MOST_TOLD else ""
            notes.append(
                f"{own.measurement.label}: from {', from '.join(told[:MOST_TOLD])}{more}, unlike "
                "all the rest. That is left out, as a push or a slip would be; if it was the floor "
                "or the robot, drive there again, and longer."
            )
    return notes


def held_notes(opened: Sequence[Opened], findings: Sequence[Finding]) -> list[str]:
    """Where a loss for a while was found: a sentence on each robot that then did not move at all.

    Args:
        opened: with the models as given.
        findings: of the motion.
    """
    if not any(WHILE in (f.effect, *(f.group or ())) for f in findings):
        return []
    notes = []
    for own in opened:
        whiles = held(own) if own.floor and own.data is not None else []
        if whiles:
            told = ", ".join(f"from {begin_s:.1f} to {end_s:.1f} s" for begin_s, end_s in whiles)
            notes.append(
                f"{own.measurement.label}: {told} it stood though it was told to drive: it was "
                "held, or its motors were off."
            )
    return notes


def lag_notes(spread_s: float) -> list[str]:
    """A sentence on motor lags that differ among robots of a kind; none where they may be one.

    Args:
        spread_s: their standard deviation; 0 where they may be one.
    """
    if not spread_s:
        return []
    ms = 1000 * spread_s
    return [
        f"The robots' motor lags differ by {ms:.1f} ms (one standard deviation); each has its own."
    ]


def heading_notes(datasets: Sequence[ErrorDataset], models: Sequence[native.Model]) -> list[str]:
    """A sentence on headings that were not recorded: those that were found in their place.

    Args:
        datasets: of one or more robots; tables have no heading.
        models: one for each, fitted.
    """
    found = [
        np.degrees(model.get(HEADING))
        for data, model in zip(datasets, models, strict=True)
        if isinstance(data, Trajectory) and not data.measurement.track.has_heading
    ]
    if not found:
        return []
    least, middle, most = np.round(np.percentile(found, (0, 50, 100))).astype(int)
    each = f"in {len(found)} tracks {least} to {most} degrees, {middle} in the middle"
    return [
        "No heading was recorded. What the robot held was found from how it moves against its "
        f"commands: {each if len(found) > 1 else f'{middle} degrees'}."
    ]


def answers_notes(opened: Sequence[Opened]) -> list[str]:
    """A sentence where commands answer how the robot strayed: what that leaves open."""
    own = [o.measurement.label for o in opened if o.floor and o.floor.answered]
    if not own:
        return []
    return [
        f"{', '.join(own)}: the commands answer how the robot strayed, as a controller's do, so "
        f"that they tell of noise. What is left up to {SETTINGS.answered} times the noise may be "
        "that, and is not told; a drive by a script, that does not look at the robot, would tell "
        "more."
    ]


def few_commands_notes(opened: Sequence[Opened]) -> list[str]:
    """A sentence where the logs have few commands: the model at others is a guess."""
    few = of_few_commands(opened)
    return [f"{few[0].upper()}{few[1:]}."] if few else []


def marker_notes(logs: Sequence[ModelledLog]) -> list[str]:
    """Sentences on robots whose poses are far noisier than those of the others.

    Args:
        logs: of several robots; of one or two nothing is said.
    """
    noises = {s.measurement.track.robot_id: s.noise for s in logs if s.noise}
    if len(noises) < 3:
        return []
    notes = []
    for channel, unit, size in (("position", "mm", 1e3), ("heading", "degrees", 180 / np.pi)):
        sensor = {i: getattr(n, channel).sensor for i, n in noises.items()}
        usual = float(np.median(list(sensor.values())))
        notes += [
            f"R{i:02d}: its {channel}s are {own / usual:.0f} times as noisy as those of the others "
            f"({size * own:.2g} {unit} against {size * usual:.2g}): look at its marker or tag."
            for i, own in sensor.items()
            if own > SETTINGS.noisy * usual
        ]
    return notes


def _ahead_m2(measured: np.ndarray) -> np.ndarray:
    """(H, 2) square of the way that is still ahead, mean over time, of (W, H, 3) displacements.

    Forward and left, seen from the start. A heading that wanders by dW at a time turns all the way
    that is ahead then, so that the end goes astray by the integral of it. A third of the square on
    a straight way; between two horizons the way is taken as straight.
    """
    times_s = np.array([0.0, *HORIZONS_S])
    places = np.concatenate([np.zeros((len(measured), 1, 2)), measured[..., :2]], axis=1)
    found = []
    for end in range(1, len(times_s)):
        ahead = places[:, [end]] - places[:, : end + 1]
        a, b = ahead[:, :-1], ahead[:, 1:]
        squares = np.nanmean((a * a + a * b + b * b) / 3, axis=0)
        found.append(np.diff(times_s[: end + 1]) @ squares / times_s[end])
    return np.array(found)


def irregularity(own: Opened, noise: Noise, model: native.Model, known_mps: float = 0.0) -> float:
    """Floor of a log over what the sensor's noise and the model's disturbance make.

    The largest of the three channels, each the geometric mean over horizons, or at the longest
    one: beside a noisy sensor a disturbance shows there alone. The sensor's noise is the log's own.
    A turn by the disturbance leads what is ahead of the robot's way aside. Wheels slip by a share
    of their way: where the robot drives faster than at `known_mps`, at which the model's
    disturbance was told, more of it is usual.
    """
    faster = max(noise.speed_mps / known_mps, 1.0) if known_mps else 1.0
    position, heading = (
        ChannelNoise(
            sensor,
            faster * max(model.get(f"noise.{drive}"), least),
            model.get(f"noise.{memory}"),
        )
        for sensor, drive, memory, least in (
            (noise.position.sensor, "drive_mps", "drive_s", LEAST_DRIVE[0]),
            (noise.heading.sensor, "drive_radps", "drive_turn_s", LEAST_DRIVE[1]),
        )
    )
    horizons_s = np.array(HORIZONS_S)
    along, turn = position.displaced(horizons_s), heading.displaced(horizons_s)
    led = along[:, None] + turn[:, None] * _ahead_m2(own.trajectory.measured)[:, ::-1]
    usual = np.sqrt(np.column_stack([led, turn]))
    with np.errstate(invalid="ignore"):
        over = np.log(own.known_floor.rms / usual)
    known = np.isfinite(over).any(axis=0)
    if not known.any():
        return 0.0
    mean, last = np.nanmean(over[:, known], axis=0), np.nan_to_num(over[-1, known], nan=-np.inf)
    return float(np.exp(max(mean.max(), last.max())))
