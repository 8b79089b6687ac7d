# SPDX-License-Identifier: Apache-2.0
"""The history of one robot: a JSON line for each calibration, appended by a fit."""

import fcntl
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from hashlib import sha256
from pathlib import Path
from typing import Any

from twinmill.arguments import option
from twinmill.data.measurement import Measurement, of_one_robot
from twinmill.data.steady_table import SteadyTable
from twinmill.data.units import date_of
from twinmill.files import plain
from twinmill.fitting.fit import FitResult

SUFFIX = ".jsonl"


@dataclass(frozen=True)
class Number:
    """One fitted number of a calibration.

    Attributes:
        std: half of a 95 % interval over 1.96.
        words: what it is, for people.
    """

    name: str
    value: float
    std: float
    unit: str
    words: str


@dataclass(frozen=True)
class Calibration:
    """One line.

    Attributes:
        recorded_utime_us: when the earliest of its logs was recorded.
        robot_id: of the robot.
        model: name of the new model file.
        model_sha256: of its text.
        logs: path and SHA-256 of each log; paths are relative to the history's folder.
        score: of the new model.
        numbers: that the logs tell.
    """

    recorded_utime_us: int
    robot_id: int
    model: str
    model_sha256: str
    logs: tuple[tuple[str, str], ...]
    score: float | None
    numbers: tuple[Number, ...]

    @property
    def date(self) -> datetime | None:
        """When it was recorded; None where its logs do not say."""
        return date_of(self.recorded_utime_us)

    @property
    def date_json(self) -> str | None:
        """Date in the form of the interface, null where there is none."""
        return f"{self.date:%Y-%m-%dT%H:%M:%SZ}" if self.date else None

    def to_json(self) -> dict[str, Any]:
        """The line's object."""
        return {
            "date": self.date_json,
            **vars(self),
            "logs": [{"path": path, "sha256": digest} for path, digest in self.logs],
            "numbers": [vars(n) for n in self.numbers],
        }

    @classmethod
    def from_json(cls, line: dict[str, Any]) -> "Calibration":
        """As `to_json` gives it.

        Raises:
            KeyError, TypeError, ValueError: it is none.
        """
        names = Number.__dataclass_fields__
        numbers = [Number(**{name: n[name] for name in names}) for n in line["numbers"]]
        if not all(isinstance(v, float | int) for n in numbers for v in (n.value, n.std)):
            raise ValueError("a number of it is none")
        return cls(
            recorded_utime_us=int(line["recorded_utime_us"]),
            robot_id=int(line["robot_id"]),
            model=str(line["model"]),
            model_sha256=str(line["model_sha256"]),
            logs=tuple((str(log["path"]), str(log["sha256"])) for log in line["logs"]),
            score=line["score"],
            numbers=tuple(numbers),
        )


def read_history(path: Path) -> list[Calibration]:
    """All calibrations by date, or as they were appended where any has none.

    Of one log that was fitted again it is the last one.

    Raises:
        ValueError: it cannot be read, or a line of it is damaged.
    """
    try:
        lines = Path(path).read_text().split("\n")
    except OSError as error:
        raise ValueError(
            f"{path}: cannot be read ({error.strerror}); give the file that `twinmill fit` with "
            f"{option('history')} writes."
        ) from error
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: is no history, which is text: {error}.") from error
    found: dict[tuple[str, ...], Calibration] = {}
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            one = Calibration.from_json(json.loads(line))
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(
                f"{path}: line {number} is damaged, or was not written by a fit "
                f"({option('history')}); delete that line and fit its log again."
            ) from error
        found[tuple(digest for _, digest in one.logs)] = one
    if all(one.date for one in found.values()):
        return sorted(found.values(), key=lambda c: c.recorded_utime_us)
    return list(found.values())


def check_history(
    path: Path, measurements: Sequence[Measurement | SteadyTable]
) -> list[Measurement]:
    """The runs whose calibration can be appended: tried before the long work.

    Raises:
        ValueError: what is there is no history, or one of another robot.
        LogError: these are several robots, or tables.
    """
    of = f"{path}: a history is of one robot's logs, and these hold"
    runs = of_one_robot(measurements, of, "fit each robot's logs by themselves")
    if not path.exists():
        return runs
    robot = runs[0].track.robot_id
    if other := next((c for c in read_history(path) if c.robot_id != robot), None):
        raise ValueError(
            f"{path}: is the history of robot {other.robot_id}, and these logs are of robot "
            f"{robot}; give each robot a file of its own."
        )
    if path.stat().st_size and not path.read_bytes().endswith(b"\n"):
        raise ValueError(f"{path}: its last line has no end; put a line feed behind it.")
    return runs


def calibration(
    result: FitResult, measurements: Sequence[Measurement], logs: Sequence[Path], history: Path
) -> Calibration:
    """Line of a history that a fit makes.

    Args:
        result: of the fit.
        measurements: what it was fitted to, of one robot.
        logs: their files.
        history: the file that it is for.
    """
    folder = history.resolve().parent
    return Calibration(
        recorded_utime_us=min(m.recorded_utime_us for m in measurements),
        robot_id=measurements[0].track.robot_id,
        model=result.path.name,
        model_sha256=sha256(result.path.read_bytes()).hexdigest(),
        logs=tuple(
            (os.path.relpath(log.resolve(), folder), sha256(log.read_bytes()).hexdigest())
            for log in logs
        ),
        score=plain(result.after.score),
        numbers=tuple(
            Number(e.name, e.value, e.std, e.unit, e.short) for e in result.parameters if e.seen
        ),
    )


def append(path: Path, line: Calibration) -> None:
    """Adds one line: whole or not at all, and never within that of another program.

    Raises:
        OSError: it cannot be written.
    """
    text = (json.dumps(plain(line.to_json()), allow_nan=False) + "\n").encode()
    with path.open("ab", buffering=0) as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        size = os.fstat(file.fileno()).st_size
        try:
            if file.write(text) != len(text):
                raise OSError(f"{path}: no space is left for another line.")
            os.fsync(file.fileno())
        except BaseException:
            file.truncate(size)
            raise


def healthy_logs(given: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """Logs, and those of histories among them that are still there.

    Returns:
        The logs, and a sentence on each that is not there or is another one by now.
    """
    logs, missing = [], []
    for path in given:
        if path.suffix != SUFFIX:
            logs.append(path)
            continue
        for name, digest in (log for line in read_history(path) for log in line.logs):
            log = path.resolve().parent / name
            if not log.is_file():
                missing.append(f"{path}: its log {name} is not there, and is left out.")
            elif sha256(log.read_bytes()).hexdigest() != digest:
                missing.append(f"{path}: its log {name} has changed, and is left out.")
            else:
                logs.append(log)
    return logs, missing
