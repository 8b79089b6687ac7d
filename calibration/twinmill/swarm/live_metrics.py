# SPDX-License-Identifier: Apache-2.0
"""Metrics of the swarms on the bus, computed again every second."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.arguments import option
from twinmill.data.lcm_log import Events, LogError
from twinmill.data.log import Log, decode_log
from twinmill.data.stream import BATCH_S, Window, from_bus
from twinmill.swarm.metrics import WINDOW_S, SwarmSeries, swarm_metrics

EVERY_S = 1.0
HEARD_S = WINDOW_S + 1.0  # longer than the mean: velocities at its start have poses on both sides
QUIET_S = 3.0  # a swarm that said nothing for so long is not there
LOST_S = 1.0  # a robot without a valid pose for so long is left out
CHANNEL = re.compile(r"(.*?)R\d\d+_(?:TELEMETRY|POSE|DRIVE|RUN)")


@dataclass(frozen=True)
class Question:
    """Request to the bus: robots, time and metrics.

    Attributes:
        prefix: only the swarm with this channel prefix; None: all.
        range_m, body_radius_m, odd: as for swarm_metrics(); odd robots need not be there.
    """

    prefix: str | None
    range_m: float
    body_radius_m: float
    odd: list[int] | None


@dataclass(frozen=True)
class SwarmSnapshot:
    """One swarm, all channels of a prefix, in its last seconds.

    Attributes:
        prefix: of its channels.
        source: who speaks, `robot` or `twin`; empty if it was not heard yet.
        lost: robots that speak, but have no valid pose now.
        t0_utime_us: time 0 of the series.
        series: None if there is no swarm to measure; `note` then says why.
        note: a sentence, or empty.
    """

    prefix: str
    source: str
    lost: list[int]
    t0_utime_us: int
    series: SwarmSeries | None
    note: str

    def to_json(self) -> dict[str, Any]:
        """Means of the last 10 s as `metrics`, the newest values as `now`."""
        data = {
            "channel_prefix": self.prefix,
            "source": self.source,
            "lost": self.lost,
            "note": self.note or None,
        }
        if not (s := self.series):
            return {**data, "class": None, "metrics": None}
        first_us, last_us = (self.t0_utime_us + round(1e6 * s.t_s[k]) for k in (0, -1))
        return {
            **data,
            "class": s.final,
            "metrics": _named(s.mean),
            "now": _named(s.values[-1]),
            "robots": s.robots,
            "odd": s.odd,
            "first_utime_us": first_us,
            "last_utime_us": last_us,
        }


def look_around(
    url: str, duration_s: float, question: Question
) -> Iterator[tuple[int, list[SwarmSnapshot], str]]:
    """(now in us, swarms by prefix, sentence if there is none) about once a second."""
    window = Window(HEARD_S)
    due_us: int | None = None
    heard_us = 0
    for now_us, batch in from_bus(url, duration_s):
        window.add(now_us, batch)
        if due_us is None:
            due_us = now_us + round(1e6 * (min(EVERY_S, duration_s) - 1.5 * BATCH_S))
            heard_us = now_us
        if now_us < due_us:
            continue
        step_us = round(1e6 * EVERY_S)
        due_us += (1 + (now_us - due_us) // step_us) * step_us
        snapshots = snapshots_of(window.events(), now_us, question)
        heard_us = now_us if snapshots else heard_us
        silent_s = (now_us - heard_us) / 1e6
        yield now_us, snapshots, "" if snapshots else _nobody(url, silent_s, question.prefix)


def snapshots_of(events: Events, now_us: int, question: Question) -> list[SwarmSnapshot]:
    """Swarms that spoke just now, by prefix."""
    prefixes = {
        match[1]
        for channel, stamps_us in events.stamps_us.items()
        if stamps_us[-1] > now_us - 1e6 * QUIET_S and (match := CHANNEL.fullmatch(channel))
    }
    if question.prefix is not None:
        prefixes &= {question.prefix}
    return [_snapshot(events, prefix, question) for prefix in sorted(prefixes)]


def _snapshot(events: Events, prefix: str, question: Question) -> SwarmSnapshot:
    try:
        log = decode_log(events, Path("the bus"), "", prefix)
    except LogError as error:
        return SwarmSnapshot(prefix, "", [], 0, None, str(error))
    tracked, lost = _tracked(log)
    source = " and ".join(sorted({robot.source for robot in log.robots.values()} - {""}))
    odd = question.odd and [i for i in question.odd if i in tracked.robots]
    try:
        series = swarm_metrics(tracked, question.range_m, question.body_radius_m, odd)
    except LogError as error:
        return SwarmSnapshot(prefix, source, lost, log.t0_utime_us, None, str(error))
    return SwarmSnapshot(prefix, source, lost, log.t0_utime_us, series, "")


def _tracked(log: Log) -> tuple[Log, list[int]]:
    """Robots with a valid pose just now, by the newest stamp of all poses; who has none."""
    newest_s = max((r.pose_t_s[-1] for r in log.robots.values() if len(r.pose_t_s)), default=0.0)
    here = {
        i: robot
        for i, robot in log.robots.items()
        if robot.valid.any() and robot.pose_t_s[robot.valid][-1] > newest_s - LOST_S
    }
    return replace(log, robots=here), sorted(set(log.robots) - set(here))


def _nobody(url: str, silent_s: float, prefix: str | None) -> str:
    who = "nobody" if prefix is None else f"nobody with the channel prefix '{prefix}'"
    if silent_s < QUIET_S:
        return f"{who} was heard on {url} yet"
    return (
        f"{who} was heard on {url} for {silent_s:.0f} s: are robots or twin_run on this network, "
        f"and is {option('lcm_url')} theirs?"
    )


def _named(values: np.ndarray) -> dict[str, float]:
    return dict(zip(native.METRICS, values.tolist(), strict=True))
