# SPDX-License-Identifier: Apache-2.0
"""What is wrong with an input, in three sentences."""

from dataclasses import asdict, dataclass

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
        fatal: the log cannot be judged as it is; false where only something about it is lost.
        log_name, robot_id: whose; -1 where it is about all robots.
        cut_s: stretches of capture's clock that are not to be judged.
        steady: one offset of the clocks may hold for the whole log; false where what the commands
            do comes later, or sooner, from some time on.
        lateness: how it changes, where that is known.
        two_clocks: poses and commands were stamped by two clocks, whatever was declared.
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

    def to_json(self) -> dict:
        """Fields of the interface."""
        return asdict(self)

    def __str__(self) -> str:
        robot = f" R{self.robot_id:02d}" if self.robot_id >= 0 else ""
        where = f"{self.log_name}{robot}: " if self.log_name or robot else ""
        return f"{where}{self.what}: {self.evidence}; {self.remedy}."


@dataclass(frozen=True)
class CheckedTrack:
    """One robot's track and what its commands do by the model's wheels, (3, 4).

    Attributes:
        label: name of its log.
        own: before what an option says of this robot alone; empty where it is the only one.
    """

    label: str
    track: Track
    body: np.ndarray
    own: str = ""

    def option(self, name: str) -> str:
        """An option of `twinmill import` up to its number: of this robot, not of all."""
        return f"{name} R{self.track.robot_id:02d}="

    def finding(
        self, what: str, evidence: str, remedy: str, *, fatal: bool = True, steady: bool = True
    ) -> InputFinding:
        """An `InputFinding` with the name of this log and the number of this robot."""
        own = self.label, self.track.robot_id
        return InputFinding(what, evidence, remedy, fatal, *own, steady=steady)
