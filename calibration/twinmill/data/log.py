# SPDX-License-Identifier: Apache-2.0
"""Reads a log into plain arrays, one set per robot, as they were recorded. Truth is never read."""

import hashlib
import re
import tomllib
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import turbopi

from twinmill.arguments import option
from twinmill.counted import counted
from twinmill.data.lcm_log import (
    Events,
    LogError,
    broken,
    decode,
    few_broken,
    most_broken,
    split_events,
)
from twinmill.data.other_files import LCM_LOG, LOOKED_AT, other_file
from twinmill.data.world_bodies import CHANNEL, WorldBody, world_bodies
from twinmill.foreign_text import NAME_MAX, first_line, plain_line

__all__ = ["Log", "LogError", "RobotLog", "read_log"]

CommandKind = Literal["duty", "wheel_speed", "twist", "none"]
KINDS: tuple[CommandKind, ...] = ("duty", "wheel_speed", "twist")  # by drive_t.kind

FAR_S = 60.0  # beside its span: no channel has single stamps so far away
ALONE = 100  # times the span of all others, of what may be held for long: a command, a row in order
LATE_S = 1.0  # a network hands messages over late by less
FARTHEST_M = 1e9  # no room is as large: such a place is damage

_READ = ("TELEMETRY", "POSE", "DRIVE", "RUN", "DETECTION")
_KNOWN_ELSEWHERE = re.compile(
    r".*(R\d\d_((SIGNED_)?ACK|LINK)|SWARM_(COMMAND|SIGNED)|TWIN_TRUTH_R\d\d|TWIN_BODY)$"
)


@dataclass(frozen=True)
class RobotLog:
    """Raw series of one robot: M commands, N poses. Times in seconds since Log.t0_utime_us.

    Attributes:
        robot_id: 0..99.
        source: who speaks in the log, `robot` or `twin`; empty if it does not say.
        behavior: name of the behaviour; empty if the log does not say.
        command_kind: what `command` holds; `none` if there are no commands.
        command_t_s: (M,) robot's clock, ascending.
        command: (M, 4) duty: fraction -1..1 per wheel; wheel_speed: rad/s per wheel; wheels in
            the order front-left, front-right, rear-left, rear-right; twist: vx_mps, vy_mps,
            omega_radps, 0.
        battery_V: (M,) NaN where not measured.
        frame_t_s: (M,) time stamp of the camera frame, robot's clock; NaN where there was none;
            (0,) without telemetry.
        mode, detected_raw, detected: (M,) int8 as in telemetry_t, the last two numbers of k bits;
            (0,) without telemetry.
        speed_input, turn_input: (M,) as in telemetry_t; (0,) without telemetry.
        pose_t_s: (N,) motion capture's clock, ascending.
        pose: (N, 3) x_m, y_m, theta_rad (unwrapped); NaN where not valid. Where the heading was
            not recorded it is NaN throughout.
        z_m: (N,) height of the tracked body; NaN where not valid.
        valid: (N,) bool.
        same_clock: the log says that one clock stamped commands and poses.
        seen_t_s: (K,) pictures of another maker's camera, robot's clock, ascending.
        seen: (K,) bool, each shows another robot.
    """

    robot_id: int
    source: str
    behavior: str
    command_kind: CommandKind
    command_t_s: np.ndarray
    command: np.ndarray
    battery_V: np.ndarray
    frame_t_s: np.ndarray
    mode: np.ndarray
    detected_raw: np.ndarray
    detected: np.ndarray
    speed_input: np.ndarray
    turn_input: np.ndarray
    pose_t_s: np.ndarray
    pose: np.ndarray
    z_m: np.ndarray
    valid: np.ndarray
    same_clock: bool = False
    seen_t_s: np.ndarray = field(default_factory=lambda: np.empty(0))
    seen: np.ndarray = field(default_factory=lambda: np.empty(0, bool))

    @property
    def has_heading(self) -> bool:
        """True if the heading was recorded, or the robot was never seen."""
        return not self.valid.any() or bool(np.isfinite(self.pose[self.valid, 2]).any())


@dataclass(frozen=True)
class Log:
    """One log file.

    Attributes:
        path: of the file.
        sha256: hex digest of its bytes.
        t0_utime_us: earliest stamp of all messages read, us since the Unix epoch: time 0 of all
            series.
        robots: by robot_id, ascending.
        warnings: sentences.
        data: bytes of a log that is in no file.
        bodies: of a twin's world.
    """

    path: Path
    sha256: str
    t0_utime_us: int
    robots: dict[int, RobotLog]
    warnings: list[str]
    data: bytes | None = field(default=None, repr=False)
    bodies: list[WorldBody] = field(default_factory=list)

    def read_bytes(self) -> bytes:
        """Bytes of its file, or of the file that `save` would write.

        Raises:
            LogError: the file cannot be read.
        """
        return read_bytes(self.path) if self.data is None else self.data


def read_log(path: str | Path, channel_prefix: str = "") -> Log:
    """Reads a log file.

    Args:
        path: an LCM log; a truncated last event is a warning.
        channel_prefix: before `R<nn>_...`; `TWIN_` is found by itself where no other is there.

    Raises:
        LogError: the file cannot be read, is no LCM log, has no robot in it, or has messages of
            another type.
    """
    path = Path(path)
    return _decoded(read_bytes(path), path, channel_prefix)


def log_of(data: bytes, name: str) -> Log:
    """A log in memory.

    Args:
        data: bytes of an LCM log.
        name: of the log, in place of a file's.

    Raises:
        LogError: as read_log.
    """
    return replace(_decoded(data, Path(name), ""), data=data)


def _decoded(data: bytes, path: Path, channel_prefix: str) -> Log:
    if (other := other_file(data[:LOOKED_AT])) and other[0] != LCM_LOG:
        raise LogError(f"{path.name}: is {other[0]}, not an LCM log; {other[1]}.")
    events, sha256 = split_events(data, path.name), hashlib.sha256(data).hexdigest()
    del data  # the payloads are copies
    return decode_log(events, path, sha256, channel_prefix)


def decode_log(events: Events, path: Path, sha256: str, channel_prefix: str = "") -> Log:
    """Decodes events as `read_log` does, but from part of a file or from a bus."""
    warnings = list(events.warnings)
    channels = _robot_channels(events.by_channel, channel_prefix, warnings)
    if not channels:
        names = ", ".join(sorted(events.by_channel)[:5])
        kinds = _match_channels(events.by_channel, channel_prefix).values()
        if any("DETECTION" in own for own in kinds):
            raise LogError(
                f"{path.name}: tells what cameras saw ({names}), and nothing of where the robots "
                "were or what they were told; import the poses and commands of the same time with "
                f"it ({option('poses')}, {option('commands')}, {option('detections')})."
            )
        raise LogError(
            f"{path.name}: no channel {channel_prefix}R<nn>_TELEMETRY, _DRIVE or _POSE "
            f"(the log has {names}); name the prefix that the log uses."
        )
    messages = {
        robot_id: _decode_robot(robot_id, kinds, warnings)
        for robot_id, kinds in sorted(channels.items())
    }
    warnings += _lacking(messages)
    t0_us = min(
        int(m["utime_us"].min()) for pair in messages.values() for m in pair if m is not None
    )
    robots = {}
    for robot_id, (commands, poses) in messages.items():
        run = _last_run(channels[robot_id].get("RUN", []), robot_id, warnings)
        robots[robot_id] = RobotLog(
            robot_id=robot_id,
            source=plain_line(run.source, NAME_MAX),
            behavior=plain_line(run.behavior, NAME_MAX),
            same_clock=_says_same_clock(run.config_toml),
            **_command_series(commands, t0_us, robot_id, warnings),
            **_pose_series(poses, t0_us, robot_id, warnings),
            **_detection_series(channels[robot_id].get("DETECTION"), t0_us, robot_id, warnings),
        )
    bodies = world_bodies(events.by_channel.get(CHANNEL, []), t0_us)
    return Log(path, sha256, t0_us, robots, warnings, bodies=bodies)


def read_bytes(path: Path) -> bytes:
    """The file's.

    Raises:
        LogError: it cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise LogError(
            f"{first_line(path)}: cannot be read ({error.strerror}); check the name."
        ) from error


def _robot_channels(
    by_channel: dict[str, Sequence[bytes]], prefix: str, warnings: list[str]
) -> dict[int, dict[str, Sequence[bytes]]]:
    """Payloads by robot and kind of channel; robots with neither commands nor poses left out."""
    found = _match_channels(by_channel, prefix)
    if not found and not prefix:
        prefix = "TWIN_"
        found = _match_channels(by_channel, prefix)
        if found:
            warnings.append("Only channels with the prefix TWIN_ are in the log; these were read.")
    unknown = [
        name
        for name in by_channel
        if not _channel_pattern(prefix).fullmatch(name) and not _KNOWN_ELSEWHERE.match(name)
    ]
    if found and unknown:
        count = sum(len(by_channel[name]) for name in unknown)
        warnings.append(
            f"{counted(count, 'message')} on {counted(len(unknown), 'other channel')} ignored "
            f"({', '.join(sorted(unknown)[:5])})."
        )
    return {
        robot_id: kinds for robot_id, kinds in found.items() if set(kinds) - {"RUN", "DETECTION"}
    }


def _channel_pattern(prefix: str) -> re.Pattern[str]:
    return re.compile(rf"{re.escape(prefix)}R(\d\d)_({'|'.join(_READ)})")


def _match_channels(
    by_channel: dict[str, Sequence[bytes]], prefix: str
) -> dict[int, dict[str, Sequence[bytes]]]:
    found: dict[int, dict[str, Sequence[bytes]]] = {}
    for name, payloads in by_channel.items():
        if match := _channel_pattern(prefix).fullmatch(name):
            found.setdefault(int(match[1]), {})[match[2]] = payloads
    return found


def _decode_robot(
    robot_id: int,
    kinds: dict[str, Sequence[bytes]],
    warnings: list[str],
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Commands and poses of a robot, in order of time; None where there are none."""
    name, said = f"R{robot_id:02d}", {}
    for source in ("TELEMETRY", "DRIVE", "POSE"):
        if source not in kinds:
            continue
        message = getattr(turbopi, f"{source.lower()}_t")
        channel = f"{name}_{source}"
        messages = decode(kinds[source], message, channel, warnings)
        messages = _undamaged(messages, channel, warnings)
        said[source] = _in_order(messages, channel, robot_id, warnings)
    if "TELEMETRY" in said and "DRIVE" in said:
        said["TELEMETRY"] = _driven(said["TELEMETRY"], said["DRIVE"], name, warnings)
    return said.get("TELEMETRY", said.get("DRIVE")), said.get("POSE")


def _driven(telemetry: np.ndarray, drive: np.ndarray, name: str, warnings: list[str]) -> np.ndarray:
    """Telemetry with the command of the same control step, where its duties drove nothing."""
    stamps, own, of_drive = np.intersect1d(
        telemetry["utime_us"], drive["utime_us"], assume_unique=True, return_indices=True
    )
    if not len(stamps):
        warnings.append(
            f"{name}: has telemetry and drive messages, and none of the same stamp; telemetry was "
            "used."
        )
        return telemetry
    if alone := len(telemetry) + len(drive) - 2 * len(stamps):
        warnings.append(
            f"{name}: {counted(alone, 'message')} of telemetry or drive without the other of the "
            "same stamp; left out."
        )
    told = ["kind", "value"]
    both = np.empty(len(stamps), telemetry.dtype.descr + [(n, drive.dtype[n]) for n in told])
    for key in telemetry.dtype.names or ():
        both[key] = telemetry[key][own]
    for key in told:
        both[key] = drive[key][of_drive]
    return both


def _lacking(messages: dict[int, tuple[np.ndarray | None, np.ndarray | None]]) -> list[str]:
    """Sentences on robots that have no commands, or no poses."""
    told = []
    for k, what in enumerate(("commands", "poses")):
        without = [f"R{robot_id:02d}" for robot_id, own in messages.items() if own[k] is None]
        if len(without) == 1:
            told.append(f"{without[0]}: has no {what}; it cannot be compared with a model.")
        elif without:
            told.append(
                f"{', '.join(without)}: have no {what}; they cannot be compared with a model."
            )
    return told


def _undamaged(messages: np.ndarray, channel: str, warnings: list[str]) -> np.ndarray:
    """Without the few whose stamp or kind is none that its channel has, as after a flipped bit.

    One stamp that is minutes early would be the beginning of the log, and of all times told of it.
    """
    alone = ALONE if channel.endswith("_DRIVE") else 1
    strange = _strays(messages["utime_us"].astype(float) / 1e6, alone)
    if "kind" in (messages.dtype.names or ()):
        kinds, counts = np.unique(messages["kind"], return_counts=True)
        strange |= messages["kind"] != kinds[counts.argmax()]
    count = int(np.count_nonzero(strange))
    if not count or not few_broken(count, len(messages)):
        return messages
    warnings.append(broken(channel, count, len(messages)))
    return messages[~strange]


def _strays(t_s: np.ndarray, alone: int) -> np.ndarray:
    """(K,) bool of stamps in file order: far beside all others, or far from their place among them.

    Args:
        t_s: (K,) stamps.
        alone: how many times as long as all others last is far.
    """
    spared = most_broken(len(t_s))
    first_s, last_s = np.sort(t_s)[[spared, -1 - spared]]
    far_s = alone * (last_s - first_s) + FAR_S
    far = (t_s < first_s - far_s) | (t_s > last_s + far_s)
    if (np.diff(t_s) >= -LATE_S).all():
        return far
    ordered = _longest_ascent(t_s)
    before_s = np.maximum.accumulate(np.where(ordered, t_s, -np.inf))
    after_s = np.minimum.accumulate(np.where(ordered, t_s, np.inf)[::-1])[::-1]
    return far | (t_s < before_s - LATE_S) | (t_s > after_s + LATE_S)


def _longest_ascent(values: np.ndarray) -> np.ndarray:
    """(K,) bool, the most that can be kept in their order so that none is below one before it."""
    ends: list[float] = []  # the lowest end of an ascent of each length
    lengths = np.empty(len(values), int)
    for k, value in enumerate(values.tolist()):
        lengths[k] = bisect_right(ends, value)
        ends[lengths[k] : lengths[k] + 1] = [value]
    kept, length, above = np.zeros(len(values), bool), len(ends) - 1, np.inf
    for k in range(len(values) - 1, -1, -1):
        if lengths[k] == length and values[k] <= above:
            kept[k], length, above = True, length - 1, values[k]
    return kept


def _in_order(messages: np.ndarray, channel: str, robot_id: int, warnings: list[str]) -> np.ndarray:
    """Sorted by stamp; of messages with the same stamp the last is kept."""
    foreign = int(np.count_nonzero(messages["robot_id"] != robot_id))
    if foreign:
        warnings.append(
            f"{channel}: {counted(foreign, 'message has', 'messages have')} another robot_id; the "
            "channel's number was used."
        )
    stamps = messages["utime_us"].astype(np.int64)
    steps = np.diff(stamps)
    if (steps > 0).all():
        return messages
    late = int(np.count_nonzero(steps < 0))
    if late:
        warnings.append(f"{channel}: {counted(late, 'stamp')} earlier than the one before; sorted.")
    order = np.argsort(stamps, kind="stable")
    last = np.append(np.diff(stamps[order]) > 0, True)
    if not last.all():
        double = counted(int(np.count_nonzero(~last)), "message repeats", "messages repeat")
        warnings.append(f"{channel}: {double} a stamp; the last one of each was kept.")
    return messages[order[last]]


def _last_run(payloads: Sequence[bytes], robot_id: int, warnings: list[str]) -> turbopi.run_t:
    """Last readable message in which the robot describes itself; empty if there is none."""
    if not payloads:
        return turbopi.run_t()
    for count, payload in enumerate(reversed(payloads)):
        try:
            run = turbopi.run_t.decode(payload)
        except Exception as error:  # the generated decoder raises what its steps happen to raise
            failed = error
            continue
        if count:
            warnings.append(broken(f"R{robot_id:02d}_RUN", count, len(payloads)))
        return run
    raise LogError(
        f"R{robot_id:02d}_RUN: a message is not of type turbopi.run_t ({failed}): "
        "the log was made with other message types."
    ) from failed


def _says_same_clock(config_toml: str) -> bool:
    """True if the import noted one clock; robots write other things, or no TOML at all."""
    try:
        table = tomllib.loads(config_toml).get("import")
    except (tomllib.TOMLDecodeError, RecursionError):
        return False
    return isinstance(table, dict) and table.get("same_clock") is True


def _command_series(
    messages: np.ndarray | None, t0_us: int, robot_id: int, warnings: list[str]
) -> dict[str, Any]:
    """The command fields of RobotLog."""
    count = 0 if messages is None else len(messages)
    series: dict[str, Any] = {
        "command_kind": "none",
        "command_t_s": np.empty(0),
        "command": np.empty((0, 4)),
        "battery_V": np.full(count, np.nan),
        "frame_t_s": np.empty(0),
        "mode": np.empty(0, np.int8),
        "detected_raw": np.empty(0, np.int8),
        "detected": np.empty(0, np.int8),
        "speed_input": np.empty(0),
        "turn_input": np.empty(0),
    }
    if messages is None:
        return series
    series["command_t_s"] = _seconds(messages, t0_us)
    if "kind" in (messages.dtype.names or ()):
        kind, command = _drive_kind(messages, robot_id), messages["value"].astype(float)
    else:
        kind, command = "duty", messages["wheel_duty_pct"].astype(float)
    if "mode" in (messages.dtype.names or ()):
        series["battery_V"] = messages["battery_V"].astype(float)
        for name in ("mode", "detected_raw", "detected"):
            series[name] = messages[name].copy()
        stamp_us = messages["frame_utime_us"].astype(np.int64)
        series["frame_t_s"] = np.where(stamp_us > 0, (stamp_us - t0_us) / 1e6, np.nan)
        for name in ("speed_input", "turn_input"):
            series[name] = messages[name].astype(float)
    if not np.isfinite(command).all():
        raise LogError(
            f"R{robot_id:02d}: {np.count_nonzero(~np.isfinite(command).all(axis=1))} "
            "commands are not finite numbers; repair the program that wrote the log."
        )
    if kind == "duty":
        command = _duty_fraction(command, robot_id, warnings)
    return series | {"command_kind": kind, "command": command}


def _detection_series(
    payloads: Sequence[bytes] | None, t0_us: int, robot_id: int, warnings: list[str]
) -> dict[str, Any]:
    """The fields of RobotLog on pictures."""
    if not payloads:
        return {}
    channel = f"R{robot_id:02d}_DETECTION"
    messages = decode(payloads, turbopi.detection_t, channel, warnings)
    messages = _undamaged(messages, channel, warnings)
    messages = _in_order(messages, channel, robot_id, warnings)
    return {"seen_t_s": _seconds(messages, t0_us), "seen": messages["seen"] != 0}


def _drive_kind(messages: np.ndarray, robot_id: int) -> CommandKind:
    kinds = np.unique(messages["kind"])
    if len(kinds) != 1 or not 0 <= kinds[0] < len(KINDS):
        raise LogError(
            f"R{robot_id:02d}_DRIVE: holds kinds {_listed(kinds)}, but a log must keep "
            "to one of 0 (duty), 1 (wheel speed), 2 (twist); split the log."
        )
    return KINDS[kinds[0]]


def _duty_fraction(duty_pct: np.ndarray, robot_id: int, warnings: list[str]) -> np.ndarray:
    outside = int(np.count_nonzero((np.abs(duty_pct) > 100).any(axis=1)))
    if outside:
        warnings.append(
            f"R{robot_id:02d}: {counted(outside, 'command has', 'commands have')} a duty outside "
            "-100..100 percent; clamped, as the motor board does."
        )
    return np.clip(duty_pct, -100, 100) / 100


def _pose_series(
    messages: np.ndarray | None, t0_us: int, robot_id: int, warnings: list[str]
) -> dict[str, Any]:
    """The pose fields of RobotLog."""
    if messages is None:
        return {
            "pose_t_s": np.empty(0),
            "pose": np.empty((0, 3)),
            "z_m": np.empty(0),
            "valid": np.empty(0, bool),
        }
    position_m = messages["position_m"].astype(float)
    quaternion = messages["orientation_wxyz"].astype(float)
    stated = messages["valid"] != 0
    placed = (np.abs(position_m) < FARTHEST_M).all(axis=1)  # NaN compares false
    turned = np.abs(np.linalg.norm(np.clip(quaternion, -2, 2), axis=1) - 1) < 0.1
    seen = stated & placed
    has_heading = not seen.any() or not np.isnan(quaternion[seen]).all()
    valid = seen & turned if has_heading else seen
    if (stated & ~valid).any():
        wrong = counted(int(np.count_nonzero(stated & ~valid)), "pose")
        warnings.append(
            f"R{robot_id:02d}_POSE: {wrong} marked valid "
            "without position or unit quaternion; taken as lost."
        )
    pose = np.full((len(messages), 3), np.nan)
    pose[valid, :2] = position_m[valid, :2]
    if has_heading:
        pose[valid, 2] = np.unwrap(heading_rad(quaternion[valid]))
    return {
        "pose_t_s": _seconds(messages, t0_us),
        "pose": pose,
        "z_m": np.where(valid, position_m[:, 2], np.nan),
        "valid": valid,
    }


def heading_rad(quaternion_wxyz: np.ndarray) -> np.ndarray:
    """Direction of the body's x axis on the floor, (N, 4) unit quaternions to (N,) rad."""
    w, x, y, z = quaternion_wxyz.T
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def _seconds(messages: np.ndarray, t0_us: int) -> np.ndarray:
    return (messages["utime_us"].astype(np.int64) - t0_us) / 1e6


def _listed(values: Iterable[object]) -> str:
    return ", ".join(str(value) for value in values)
