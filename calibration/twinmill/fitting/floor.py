# SPDX-License-Identifier: Apache-2.0
"""The noise floor: how far the best smooth response to the commands misses, whatever the model.

It is a property of the log. Of the model file only the robot's form is used (drive, wheels,
geometry), with numbers refitted to this very log. So better predictions never get a worse score.
It is the root mean square of the response's errors on the parts that it was fitted to, which are
less than the noise, and on those that it was not, which are more.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import twinmill_native as native

from twinmill.fitting.answers import are_answers
from twinmill.fitting.dependence import (
    INSTANT_S,
    beat,
    dependences,
    known_physics,
    lags_that_change,
    place_gains,
    small_changes,
    wheel_angles,
)
from twinmill.fitting.independence import independent_shares
from twinmill.fitting.response import Response
from twinmill.fitting.score_fit import ScoreFit
from twinmill.fitting.settings import FLOOR_SETTINGS
from twinmill.model.parameters import (
    ALIGNMENT,
    BASE_GAINS,
    CLOCK,
    HEADING,
    LAG,
    base_parameters,
    duty_table,
    effect_parameters,
    gains_of,
)
from twinmill.predict.datasets import Trajectory
from twinmill.predict.windows import HORIZONS_S, rms

HORIZON = HORIZONS_S.index(0.5)
PAUSE_S = 2.5  # between the starts of windows of two disturbances; a robot may rest meanwhile
ARM_M = 0.1  # a turn counts as the way of a point so far from the middle
LOOKS = 3  # at most, for what a disturbance hides
WAYS = 5  # parts of the windows by their way, of each of which the median error is taken
REACH_S = 1.0  # delays and offsets that are looked for


@dataclass(frozen=True)
class NoiseFloor:
    """Floor of one robot's errors in one log, by noise alone.

    Attributes:
        rms: (H, 3) errors that count as one; NaN where a channel does not move.
        keep: (W,) bool: windows that are judged; the others hold a bump that was over soon.
        kind: "response"; None if the log cannot give a floor.
        reason: why it cannot; empty otherwise.
        offset_s: capture's clock less the robot's, with which it was found.
        heading_rad: that the robot holds where it was not recorded; else 0.
        lateness_s: lag and delay of the base refitted to the log; NaN where the clocks are two.
        across: (W, H, 3) errors of the response on parts that it was not fitted to.
        response: itself.
        independent: (3,) share of the errors of each channel that are.
        answered: later commands tell of earlier errors, so that the floor is too low.
    """

    rms: np.ndarray
    keep: np.ndarray
    kind: str | None
    reason: str
    offset_s: float
    heading_rad: float
    lateness_s: float
    across: np.ndarray
    response: Response | None
    independent: np.ndarray = field(default_factory=lambda: np.ones(3))
    answered: bool = False

    def thinned(self, every: int) -> "NoiseFloor":
        """Floor seen from every Nth start alone."""
        response = self.response and self.response.thinned(every)
        keep, across = self.keep[::every], self.across[::every]
        return replace(self, keep=keep, across=across, response=response)


def noise_floor(data: Trajectory, model: native.Model, same_clock: bool) -> NoiseFloor:
    """Finds the noise floor of one robot in one log.

    Args:
        data: windows.
        model: of the robot; only its form is used.
        same_clock: commands and poses are stamped by one clock.
    """
    reason = too_poor(data)
    if reason:
        return no_floor(data, reason)
    velocity, base = base_response(data, model, same_clock)
    offset_s = base.get(CLOCK)
    response = Response(data, velocity, base.get(LAG), offset_s)
    response.boost(list(place_gains(response.motion)))
    moved = data.measured - data.errors(base)
    response, calm, far = _calm(data, response, moved)
    points = response.points
    known = known_physics(base, velocity[points], lambda m: body_velocities_at(data, m, points))
    response.find_wheels(base)
    response.find_beat()
    motion = response.motion
    told, own = told_velocity_at(data, base, points), base.drive != "twist"
    small = small_changes(told, base.get(LAG), motion, response.wheels if own else ())
    answered = are_answers(data.measured - moved, response.across, data.start_s)
    # Answers tell of noise, and a lag that changes with the command would take it for motion.
    lags = () if answered else lags_that_change(told, response.lag_s, motion)
    angles, beats = wheel_angles(motion, response.wheels), beat(motion, response.beat_radps)
    response.boost([*dependences(motion), *small, *lags, *angles, *beats, *known])
    within, across = (
        np.where(calm[:, None, None], e, np.nan) for e in (response.within, response.across)
    )
    floor = np.sqrt((rms(within) ** 2 + rms(across) ** 2) / 2)
    moves = rms(data.measured) > 1e-9
    return NoiseFloor(
        rms=np.where(moves, np.maximum(floor, 1e-9), np.nan),
        keep=calm | _lasting(data, moved, ~calm | far),
        kind="response",
        reason="",
        offset_s=offset_s,
        heading_rad=base.get(HEADING),
        lateness_s=base.get(LAG) + (base.get("input_delay.delay_s") if same_clock else np.nan),
        across=response.across,
        response=response,
        independent=independent_shares(across, data.start_s),
        answered=are_answers(data.measured - moved, across, data.start_s),
    )


def base_response(
    data: Trajectory, model: native.Model, same_clock: bool
) -> tuple[np.ndarray, native.Model]:
    """(N, 3) velocity at each pose, m/s and rad/s, of the base refitted to this log; that base."""
    base = model.form()
    for name in [HEADING] if same_clock else ALIGNMENT:
        base.set(name, 0.0)
    scale_speeds(data, base)
    names = [*acting_gains(data, base), LAG]
    table = duty_table(base)
    if len(table) > 1:
        names = [n for n in names if n != "base.forward_gain"] + table
    if same_clock:
        base.add_effect("input_delay")
        base.set("input_delay.delay_s", 0.02)
        late = effect_parameters(base, "input_delay")
    else:
        base.set(CLOCK, coarse_offset_s(data, base))
        late = base_parameters(base, [CLOCK])
    if not data.measurement.track.has_heading:
        base.set(HEADING, coarse_heading_rad(data, base))
        late += base_parameters(base, [HEADING])
    for _ in range(3):
        own = data.over(rms(data.errors(base)))
        free = [p.at(base.get(p.name)) for p in base_parameters(base, names) + late]
        base = ScoreFit([own], [base], free).fit(8).models[0]
    return body_velocity_at(data, base, slice(None)), base


def scale_speeds(data: Trajectory, base: native.Model) -> None:
    """Speeds of a duty robot at which the base drives as far as the log; it is changed."""
    table = duty_table(base)
    if not table:
        return
    ways_m = [
        np.linalg.norm(rms(own)[0] * (1.0, 1.0, ARM_M))
        for own in (data.measured, data.measured - data.errors(base))
    ]
    if min(ways_m) > 0:
        for name in table:
            base.set(name, float(base.get(name) * ways_m[0] / ways_m[1]))


def body_velocity_at(
    data: Trajectory, model: native.Model, points: np.ndarray | slice
) -> np.ndarray:
    """(N, 3) predicted body velocity, m/s and rad/s, in the step that ends at each of some poses.

    At a frame that was lost it is that of the step over the loss. Zero where there is none.
    """
    return body_velocities_at(data, [model], points)[0]


def body_velocities_at(
    data: Trajectory, models: Sequence[native.Model], points: np.ndarray | slice
) -> np.ndarray:
    """(B, N, 3) the same of several models."""
    track = data.measurement.track
    seen = np.flatnonzero(track.segment >= 0)
    place = np.searchsorted(seen, np.arange(len(track.pose_t_s))[points])
    there = place < len(seen)
    at, again = np.unique(seen[place[there]], return_inverse=True)
    velocities = native.velocities(list(models), data.measurement.played, at)
    if len(at) == len(place):  # each pose once, and they ascend
        return velocities
    found = np.zeros((len(models), len(place), 3))
    found[:, there] = velocities[:, again]
    return found


def told_velocity_at(
    data: Trajectory, model: native.Model, points: np.ndarray | slice
) -> np.ndarray:
    """(N, 3) as `body_velocity_at`, of a robot whose motors do not lag: as it is told."""
    instant = model.copy()
    instant.set(LAG, INSTANT_S)
    return body_velocity_at(data, instant, points)


def coarse_offset_s(data: Trajectory, base: native.Model) -> float:
    """Offset of the clocks at which the base predicts best, of a grid from -1 to 1 s."""
    grid = np.arange(-REACH_S, REACH_S + 0.01, 0.05) + base.get(CLOCK)
    own = data.over(rms(data.measured))
    squares = (own.rows(base, [CLOCK], grid[:, None]) ** 2).sum(axis=1)
    return float(grid[np.argmin(squares)])


def coarse_heading_rad(data: Trajectory, base: native.Model) -> float:
    """Heading at which the base predicts best, of a whole turn in steps of 15 degrees."""
    grid = np.radians(np.arange(-180.0, 180.0, 15.0))
    own = data.over(rms(data.measured))
    squares = (own.rows(base, [HEADING], grid[:, None]) ** 2).sum(axis=1)
    return float(grid[np.argmin(squares)])


def acting_gains(data: Trajectory, model: native.Model) -> list[str]:
    """Gains of the base along which its wheels and the log's commands move the robot."""
    gains, track = gains_of(model), data.measurement.track
    if track.command_kind != "twist":
        return gains
    return [n for n in gains if track.command[:, BASE_GAINS.index(n)].any()]


def _calm(
    data: Trajectory, response: Response, moved: np.ndarray
) -> tuple[Response, np.ndarray, np.ndarray]:
    """The response without disturbances, (W,) windows that hold none, and those that are far off.

    Large errors hide smaller ones, such as of a prediction that just reaches into a disturbance:
    what is far off beside it is looked for again.
    """
    far = is_far(response.across, response.errors, FLOOR_SETTINGS.bump_part, moved)
    calm = _without_bumps(data, response, far, moved)
    if calm.all():
        return response, calm, far
    near, response = overlapping(data, ~calm), response.of_windows(calm)
    for _ in range(LOOKS):
        hidden = is_far(response.across, response.errors, FLOOR_SETTINGS.bump_part, moved)
        hidden &= calm & near
        if not hidden.any() or (hidden | ~calm).mean() >= FLOOR_SETTINGS.rare_bumps:
            break
        calm, far = calm & ~hidden, far | hidden
        response = response.of_windows(calm)
    return response, calm, far


def _without_bumps(
    data: Trajectory, response: Response, far: np.ndarray, moved: np.ndarray
) -> np.ndarray:
    """(W,) windows without disturbances, nor a part of one, which is `far` (W,) off.

    A robot that is disturbed often is so by itself: the parts are left in.
    """
    disturbed = is_far(response.across, response.errors, FLOOR_SETTINGS.bump, moved)
    if not disturbed.any() or disturbed.mean() > FLOOR_SETTINGS.most_bumps:
        return np.ones(len(disturbed), bool)
    parts = far & overlapping(data, disturbed)
    rare = (disturbed | parts).mean() < FLOOR_SETTINGS.rare_bumps
    return ~disturbed & ~parts if rare else ~disturbed


def overlapping(data: Trajectory, disturbed: np.ndarray) -> np.ndarray:
    """(W,) windows that may overlap one of those that are disturbed."""
    apart_s = np.abs(data.start_s[:, None] - data.start_s[disturbed])
    return apart_s.min(axis=1) < HORIZONS_S[-1]


def _lasting(data: Trajectory, moved: np.ndarray, far: np.ndarray) -> np.ndarray:
    """(W,) windows that are off by no bump: for a while all of the motion is less, or more.

    Disturbed ones tell nothing of the noise, and are judged. `far` (W,) are off at all.
    """
    found = np.zeros(len(far), bool)
    measured, predicted = (d[:, HORIZON] * (1, 1, ARM_M) for d in (data.measured, moved))
    missed = measured - predicted
    index = np.flatnonzero(far & np.isfinite(measured).all(axis=1))
    for part in np.split(index, 1 + np.flatnonzero(np.diff(data.start_s[index]) > PAUSE_S)):
        if len(part) and np.ptp(data.start_s[part]) >= FLOOR_SETTINGS.lasts_s:
            own, told = measured[part], predicted[part]
            share = np.sum(own * told) / max(np.sum(told**2), 1e-12)
            left = np.sum((own - share * told) ** 2) / max(np.sum(missed[part] ** 2), 1e-12)
            low, high = FLOOR_SETTINGS.least_way, 2 - FLOOR_SETTINGS.least_way
            found[part] = low < share < high and left < FLOOR_SETTINGS.uneven
    return found


def is_far(errors: np.ndarray, floor: np.ndarray, times: float, moved: np.ndarray) -> np.ndarray:
    """(W,) windows whose mean squared error over the floor is so many times the usual one.

    A robot that stands most of the time is not disturbed whenever it drives: of those that move
    farther more is usual, where more is missed by most of them.

    Args:
        errors: (W, H, 3); NaN where nothing was measured.
        floor: (H, 3); not judged where it is 0, NaN or infinite.
        times: the limit.
        moved: (W, H, 3) predicted displacements.
    """
    floor = np.where(np.isfinite(floor) & (floor > 1e-9), floor, np.nan)
    size = rms(moved)
    over, ways = errors / floor, moved / np.where(size > 0, size, np.nan)
    missed, way = _mean_square(over), _mean_square(np.where(np.isfinite(over), ways, np.nan))
    return missed > times * _usual(missed, way)


def _mean_square(over: np.ndarray) -> np.ndarray:
    """(W,) of what is finite; NaN where nothing is."""
    counts = np.isfinite(over).sum(axis=(1, 2))
    return np.nansum(over**2, axis=(1, 2)) / np.where(counts, counts, np.nan)


def _usual(missed: np.ndarray, way: np.ndarray) -> np.ndarray:
    """(W,) of the squares that are usual at such squares of the way: medians, in a line.

    Nowhere less than the median of all.
    """
    usual = np.full(len(missed), np.nanmedian(missed))
    both = np.flatnonzero(np.isfinite(missed) & np.isfinite(way))
    if len(both) < FLOOR_SETTINGS.fewest_windows:
        return usual
    parts = np.array_split(both[np.argsort(way[both])], WAYS)
    at, medians = np.array([(way[p].mean(), np.median(missed[p])) for p in parts]).T
    away = at - at.mean()
    slope = away @ medians / max(away @ away, 1e-12)
    return np.fmax(usual, medians.mean() + slope * (way - at.mean())) if slope > 0 else usual


def too_poor(data: Trajectory) -> str:
    """Why a log can give no floor; empty if it can."""
    whole = np.count_nonzero(np.isfinite(data.measured[:, -1, 0]))
    if len(data.windows.starts) < FLOOR_SETTINGS.fewest_windows:
        return (
            f"{data.label}: {len(data.windows.starts) * 0.25:.0f} s of unbroken poses are too "
            "short to tell the noise from the motion; record half a minute or more"
        )
    if whole < FLOOR_SETTINGS.fewest_long:
        return (
            f"{data.label}: its poses break so often that they are whole over the longest horizon "
            f"at {whole} times, too few to tell the noise from the motion; look at where and why "
            "they break"
        )
    if not np.diff(data.measurement.track.command, axis=0).any():
        return (
            f"{data.label}: the commands never change, so nothing tells the noise from the motion"
        )
    return ""


def no_floor(data: Trajectory, reason: str) -> NoiseFloor:
    """Empty floor for a log that gives none, with the reason."""
    nothing = np.full(data.floor.shape, np.nan)
    empty = np.full(data.measured.shape, np.nan)
    everything = np.ones(len(data.measured), bool)
    return NoiseFloor(
        rms=nothing,
        keep=everything,
        kind=None,
        reason=reason,
        offset_s=0.0,
        heading_rad=0.0,
        lateness_s=np.nan,
        across=empty,
        response=None,
    )
