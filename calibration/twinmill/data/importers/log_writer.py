# SPDX-License-Identifier: Apache-2.0
"""Poses and commands of foreign measurements as a log that looks like a robot's own."""

import heapq
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
import turbopi

from twinmill.data.importers.series import CommandSeries, DetectionSeries, PoseSeries
from twinmill.data.log import KINDS
from twinmill.version import __version__

CONTROL_PERIOD_US = 22_000  # a TurboPi tells its duties once per control step, new or held

# Head of an event of LCM's log format: sync word, number, stamp in us, sizes of channel and data.
HEAD, SYNC = struct.Struct(">Iqqii"), 0xEDA1DA01

AT_ONCE = 8192  # rows

Event = tuple[int, str, bytes]  # stamp, channel, encoded message


def log_parts(
    poses: list[PoseSeries],
    commands: list[CommandSeries],
    *,
    config_toml: str,
    detections: list[DetectionSeries] | None = None,
) -> Iterator[bytes]:
    """Content of a log file, part by part, in order of stamps.

    Args:
        poses: one per robot.
        commands: one per robot; held duties are repeated every CONTROL_PERIOD_US to the last pose.
        config_toml: where all this comes from, for run_t.
        detections: one per robot that has any.
    """
    end_us = {series.robot_id: int(series.utime_us[-1]) for series in poses}
    streams = [_pose_events(series) for series in poses]
    streams += [_detection_events(series) for series in detections or []]
    for series in commands:
        streams.append(_run_event(series, config_toml))
        streams.append(
            _telemetry_events(series, end_us.get(series.robot_id, 0))
            if series.kind == "duty" and not np.any(series.value % 1)  # a board's own, in percent
            else _drive_events(series)
        )
    for number, event in enumerate(heapq.merge(*streams, key=lambda event: event[0])):
        stamp_us, channel, data = event[0], event[1].encode(), event[2]
        yield HEAD.pack(SYNC, number, stamp_us, len(channel), len(data)) + channel + data


def _run_event(series: CommandSeries, config_toml: str) -> Iterator[Event]:
    run = turbopi.run_t()
    run.utime_us, run.robot_id = int(series.utime_us[0]), series.robot_id
    run.source, run.version, run.config_toml = "robot", __version__, config_toml
    yield run.utime_us, f"R{series.robot_id:02d}_RUN", run.encode()


def _pose_events(series: PoseSeries) -> Iterator[Event]:
    channel, message = f"R{series.robot_id:02d}_POSE", turbopi.pose_t()
    message.robot_id = series.robot_id
    rows = _listed(series.utime_us, series.valid, series.position_m, series.orientation_wxyz)
    for seq, (utime_us, valid, position, orientation) in enumerate(rows):
        message.utime_us, message.seq, message.valid = utime_us, seq, int(valid)
        message.position_m, message.orientation_wxyz = position, orientation
        yield utime_us, channel, message.encode()


def _listed(*columns: np.ndarray) -> Iterator[tuple[Any, ...]]:
    """Rows of arrays as Python has numbers, AT_ONCE at a time: lists take ten times the memory."""
    for begin in range(0, len(columns[0]), AT_ONCE):
        yield from zip(*(c[begin : begin + AT_ONCE].tolist() for c in columns), strict=True)


def _detection_events(series: DetectionSeries) -> Iterator[Event]:
    channel, message = f"R{series.robot_id:02d}_DETECTION", turbopi.detection_t()
    message.robot_id = series.robot_id
    rows = (series.utime_us, series.seen, series.range_m, series.bearing_rad)
    for seq, row in enumerate(zip(*(values.tolist() for values in rows), strict=True)):
        message.utime_us, message.seq, message.seen = row[0], seq, int(row[1])
        message.range_m, message.bearing_rad = row[2:]
        yield message.utime_us, channel, message.encode()


def _drive_events(series: CommandSeries) -> Iterator[Event]:
    channel, message = f"R{series.robot_id:02d}_DRIVE", turbopi.drive_t()
    message.robot_id, message.kind = series.robot_id, KINDS.index(series.kind)
    for utime_us, value in _listed(series.utime_us, series.value):
        message.utime_us, message.value = utime_us, value
        yield utime_us, channel, message.encode()


def _telemetry_events(series: CommandSeries, end_us: int) -> Iterator[Event]:
    channel, message = f"R{series.robot_id:02d}_TELEMETRY", turbopi.telemetry_t()
    message.robot_id, message.mode, message.battery_V = series.robot_id, series.mode, np.nan
    stamps = series.utime_us.tolist()
    until = [*stamps[1:], max(end_us, stamps[-1]) + 1]
    for k, (start_us, stop_us) in enumerate(zip(stamps, until, strict=True)):
        message.wheel_duty_pct = [int(duty) for duty in series.value[k]]
        message.speed_input, message.turn_input = series.inputs[k].tolist()
        message.detected_raw, message.detected = series.detected[k].tolist()
        held = range(start_us, stop_us, CONTROL_PERIOD_US) if series.repeat else [start_us]
        for message.utime_us in held:
            yield message.utime_us, channel, message.encode()
            message.seq += 1
