# SPDX-License-Identifier: Apache-2.0
"""A recorded swarm against the twin's, by distributions: paths are chaotic, metrics are not.

The twin runs from the recorded start with many seeds. Were the floor's run one of them, any order
of the runs would be as probable as any other, so that its rank among them, by whatever statistic
treats all runs alike, gives an exact test (Dwass 1957; Besag and Clifford 1989).
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.arguments import option
from twinmill.data.log import Log
from twinmill.defaults import FALSE_ALARMS
from twinmill.programs import available_cores
from twinmill.swarm.behaviors import find_table, parse_table
from twinmill.swarm.metrics import STEP_S, SwarmSeries, body_velocity

BLOCK_S = 2.0  # metrics are means over this
STARTED_MPS = 0.02
# Metric: is it compared by its logarithm, within which bounds, and what is the least spread between
# runs that matters? Without the last, one touch of two robots were infinitely strange among runs
# that have none.
COMPARED = {
    "circliness": (True, 0.01, 100.0, 0.05),
    "radius_m": (True, 0.01, 100.0, 0.02),
    "rotation": (False, -1.0, 1.0, 0.05),
    "odd_ratio": (True, 0.01, 100.0, 0.05),
    "diffusion": (True, 0.01, 100.0, 0.1),
    "groups": (False, 1.0, 100.0, 0.3),
    "contacts": (False, 0.0, 100.0, 0.3),
}


@dataclass(frozen=True)
class RankTest:
    """Monte Carlo rank tests of the floor's run among the twin's.

    Attributes:
        p_value: of the energy distance between the floor's run and the twin's.
        p_band: of how far it strays from their middle at its worst moment.
        left: block at which it first leaves the band, and metric; None if it never does.
        low, high, middle: (B, K) band of the twin's runs as a whole: one in 40 strays out of it
            anywhere.
    """

    p_value: float
    p_band: float
    left: tuple[int, int] | None
    low: np.ndarray
    high: np.ndarray
    middle: np.ndarray

    @property
    def differs(self) -> bool:
        """True if either test says so; false alarms: FALSE_ALARMS of both together."""
        return min(self.p_value, self.p_band) <= FALSE_ALARMS / 2


def rank_test(floor: np.ndarray, twins: np.ndarray, least: np.ndarray) -> RankTest:
    """Ranks the floor's run among the twin's.

    Args:
        floor: (B, K) scaled metrics in blocks of time.
        twins: (S, B, K) of as many seeds.
        least: (K,) spread between runs that matters.
    """
    runs = np.concatenate([floor[None], twins])
    middle = np.median(runs, axis=0)
    spread = np.subtract(*np.quantile(runs, [0.84, 0.16], axis=0)) / 2
    # Moments at which all runs agree must not make the band: half of the usual spread is the least.
    scale = np.maximum(spread, np.maximum(least, 0.5 * spread.mean(axis=0)))
    off = (runs - middle) / scale
    flat = off.reshape(len(runs), -1)
    apart = np.sqrt(((flat[:, None] - flat[None]) ** 2).mean(axis=-1)).mean(axis=1)
    worst = np.abs(off).max(axis=(1, 2))
    alarms = int(FALSE_ALARMS / 2 * len(runs) + 1e-9)
    allowed = np.sort(worst[1:])[-max(alarms, 1)]
    out = np.argwhere(np.abs(off[0]) > allowed)
    return RankTest(
        float(np.mean(apart >= apart[0])),
        float(np.mean(worst >= worst[0])),
        (int(out[0, 0]), int(out[0, 1])) if len(out) else None,
        middle - allowed * scale,
        middle + allowed * scale,
        middle,
    )


def compared(has_odd: bool) -> list[str]:
    """Names of the metrics that are compared."""
    return [name for name in COMPARED if has_odd or name != "odd_ratio"]


def least_spread(names: list[str]) -> np.ndarray:
    """(K,) least standard deviations of metrics, below which no difference counts."""
    return np.array([COMPARED[name][3] for name in names])


def blocks(values: np.ndarray, names: list[str]) -> np.ndarray:
    """(T, METRICS) series STEP_S apart to (B, K) scaled means over BLOCK_S."""
    size = round(BLOCK_S / STEP_S)
    count = len(values) // size
    columns = []
    for name in names:
        logarithm, low, high, _ = COMPARED[name]
        column = values[: count * size, native.METRICS.index(name)]
        column = np.clip(np.nan_to_num(column, nan=high), low, high)
        columns.append(np.log10(column) if logarithm else column)
    return np.stack(columns, axis=-1).reshape(count, size, -1).mean(axis=1)


def plain(values: np.ndarray, names: list[str]) -> np.ndarray:
    """(..., K) scaled metrics in their own units."""
    logs = np.array([COMPARED[name][0] for name in names])
    return np.where(logs, 10.0 ** np.where(logs, values, 0), values)


def first_motion(series: SwarmSeries) -> int:
    """Place in the series at which the swarm starts."""
    speed = np.linalg.norm(np.gradient(series.pose[..., :2], STEP_S, axis=0), axis=-1).mean(axis=1)
    moving = np.flatnonzero(speed > STARTED_MPS)
    return int(max(moving[0] - 1, 0)) if len(moving) else 0


def twin_values(
    cell: native.Cell, seed: int, ring: int, scale: tuple[float, float], *, count: int
) -> np.ndarray:
    """(T, METRICS) of one seed, measured like a log: `count` samples STEP_S apart.

    Args:
        cell: with the recorded start.
        seed: of the twin.
        ring: robots that are not odd.
        scale: view range and body radius in m.
        count: T.
    """
    end_s = count * STEP_S
    trace = native.trace_world(cell, seed, end_s + 2 * STEP_S, 1e-9)
    known_s = np.arange(len(trace)) * cell.period_s
    trace[..., 2] = np.unwrap(trace[..., 2], axis=0)
    t_s = np.arange(count) * STEP_S
    after = np.searchsorted(known_s, t_s, side="right")
    weight = ((t_s - known_s[after - 1]) / cell.period_s)[:, None, None]
    pose = np.ascontiguousarray((1 - weight) * trace[after - 1] + weight * trace[after])
    return native.measure(pose, body_velocity(pose), ring, *scale)


@dataclass(frozen=True)
class SwarmComparison:
    """The floor's run and the twin's.

    Attributes:
        names: of the K metrics compared.
        t_s: (B,) middle of each block, since the swarm began to move.
        floor: (B, K) in the metrics' own units.
        twins: (S, B, K) the same.
        test: how they compare.
        robots: numbers of those that were compared.
    """

    names: list[str]
    t_s: np.ndarray
    floor: np.ndarray
    twins: np.ndarray
    test: RankTest
    robots: tuple[int, ...]

    def to_json(self) -> dict[str, Any]:
        """Verdict, tests and bands."""
        j, left = self.test, self.test.left
        low, middle, high = (plain(part, self.names) for part in (j.low, j.middle, j.high))
        return {
            "differs": j.differs,
            "false_alarm_rate": FALSE_ALARMS,
            "p_energy": j.p_value,
            "p_band": j.p_band,
            "left_band": {"t_s": self.t_s[left[0]], "metric": self.names[left[1]]}
            if left
            else None,
            "seeds": len(self.twins),
            "t_s": self.t_s,
            "series": {
                name: {
                    "floor": self.floor[:, k],
                    "low": low[:, k],
                    "middle": middle[:, k],
                    "high": high[:, k],
                }
                for k, name in enumerate(self.names)
            },
        }

    @property
    def verdict(self) -> str:
        """One or two sentences."""
        j = self.test
        tests = f"(energy distance p = {j.p_value:.3f}, band p = {j.p_band:.3f})"
        if not j.differs:
            return f"The floor's run could be one of the twin's {len(self.twins)} {tests}."
        words = f"The floor's run is not one of the twin's {len(self.twins)} {tests}."
        if j.left:
            words += (
                f" It leaves the twin's band first {self.t_s[j.left[0]]:.0f} s after the start, in "
                f"{self.names[j.left[1]]}."
            )
        return words


def compare_swarm(
    log: Log,
    series: SwarmSeries,
    model: native.Model,
    *,
    seeds: range,
    behavior: str | None = None,
    tell: Callable[[], None] = lambda: None,
) -> SwarmComparison:
    """Runs the twin from the log's start and compares.

    Args:
        log: a swarm's.
        series: its metrics.
        model: of all robots; says how far they see, and how large they are.
        seeds: of the runs of the twin.
        behavior: of all robots; None: what the log says.
        tell: is called after each run.

    Raises:
        ValueError: a behaviour is not known, or the log is too short.
    """
    begin = first_motion(series)
    values = series.values[begin:]
    count = round((series.t_s[-1] - series.t_s[begin]) / STEP_S) + 1
    names = compared(bool(series.odd))
    floor = blocks(values, names)
    if len(values) < count or len(floor) < 2:
        why = "has gaps in its poses" if len(values) < count else "is too short"
        raise ValueError(
            f"{log.path.name}: {why} after the swarm starts; at least {2 * BLOCK_S:.0f} s with "
            "poses of all robots, without a gap, are needed."
        )
    ring = len(series.robots) - len(series.odd)
    tables = [_table(behavior or log.robots[i].behavior, i) for i in series.robots]
    cell = native.Cell(model, tables, ring, poses=series.pose[begin].tolist())
    scale = model.get("sensor.range_m"), model.get("robot.body_radius_m")
    twins = []
    with ThreadPoolExecutor(available_cores()) as pool:
        for one in pool.map(lambda seed: twin_values(cell, seed, ring, scale, count=count), seeds):
            twins.append(blocks(one, names))
            tell()
    runs = np.array(twins)
    t_s = (np.arange(len(floor)) + 0.5) * BLOCK_S
    return SwarmComparison(
        names,
        t_s,
        plain(floor, names),
        plain(runs, names),
        rank_test(floor, runs, least_spread(names)),
        tuple(series.robots),
    )


def _table(name: str, robot: int) -> list[int]:
    own = find_table(name) if name else ""
    if own:
        return parse_table(f"{name}={own}")[1]
    if not name:
        raise ValueError(
            f"the log does not say what robot {robot} plays; give {option('behavior')}."
        )
    return native.species(name, 1)[0][1]
