# SPDX-License-Identifier: Apache-2.0
"""Finding about an input, in three sentences: the fault, its evidence, its remedy."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from twinmill.data.checks.lateness import Lateness
from twinmill.data.track import Track


@dataclass(frozen=True)
class InputFinding:
    """A mistake in what was recorded or imported, not in the robot's physics.

    Attributes:
        what: the mistake, a clause without a full stop.
        evidence: the numbers that show it.
        remedy: what to do.
        remedy_of_all: what to do where all robots of the log need it; empty: that is `remedy`.
        fatal: the log cannot be judged as it is; false where only something about it is lost.
        log_name, robot_id: whose; -1 where it is about all robots.
        cut_s: stretches of capture's clock that are not to be judged.
        steady: one offset of the clocks may hold for the whole log; false where what the commands
            do comes later, or sooner, from some time on.
        lateness: how it changes, where that is known.
        two_clocks: poses precede the commands that they follow, though one clock was declared.
        lever_m: the tracked point ahead and left of the point that the robot turns about, where
            that is far.
    """

    what: str
    evidence: str
    remedy: str
    fatal: bool
    log_name: str = ""
    robot_id: int = -1
    cut_s: tuple[tuple[float, float], ...] = ()
    steady: bool = True
    lateness: Lateness | None = None
    two_clocks: bool = False
    lever_m: tuple[float, float] | None = None
    remedy_of_all: str = ""

    def to_json(self) -> dict[str, Any]:
        """Fields of the interface."""
        return {name: value for name, value in asdict(self).items() if name != "remedy_of_all"}

    def __str__(self) -> str:
        robot = f" R{self.robot_id:02d}" if self.robot_id >= 0 else ""
        where = f"{self.log_name}{robot}: " if self.log_name or robot else ""
        return f"{where}{self.what}: {self.evidence}; {self.remedy}."


Remedy = str | Callable[[int | None], str]  # by the robot that its options name, None for all


def in_words(remedy: Remedy, own: int | None) -> tuple[str, str]:
    """A remedy with the options of one robot, and with those of all."""
    return (remedy, remedy) if isinstance(remedy, str) else (remedy(own), remedy(None))


@dataclass(frozen=True)
class CheckedTrack:
    """One robot's track and what its commands do by the model's wheels, (3, 4).

    Attributes:
        label: name of its log.
        own: robot_id that options are to name; None where the log has no other robot.
    """

    label: str
    track: Track
    body: np.ndarray
    own: int | None = None

    def finding(
        self, what: str, evidence: str, remedy: Remedy, *, fatal: bool = True, steady: bool = True
    ) -> InputFinding:
        """An `InputFinding` with the name of this log and the number of this robot."""
        mend, of_all = in_words(remedy, self.own)
        whose = self.label, self.track.robot_id
        return InputFinding(
            what, evidence, mend, fatal, *whose, steady=steady, remedy_of_all=of_all
        )
