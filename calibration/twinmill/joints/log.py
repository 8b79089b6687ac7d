# SPDX-License-Identifier: Apache-2.0
"""A run of a jointed robot: stamps, commands to its actuators, positions of its joints."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from twinmill.counted import counted
from twinmill.data.lcm_log import LogError

FEWEST = 40  # samples: five steps of a joint
GAP = 3.0  # periods between two samples, from which something is missing between them
APART_S = 1.0  # between runs that are joined: more than a command is late


@dataclass(frozen=True, repr=False)
class JointLog:
    """N samples of a run, as MuJoCo names and measures: rad, m, and the units of `ctrl`.

    A command holds from its stamp to the next one's.

    Attributes:
        t_s: (N,) stamps in s, ascending.
        ctrl: (N, U) commands to actuators.
        qpos: (N, J) measured positions of joints.
        qvel: (N, J) velocities as the robot tells them; they are checked against positions, and not
            used. None without.
        joints, actuators: names of the columns; None for those of the model, in its order.
        name: what messages call the log.
        begins: first sample of each run, where several are joined.
    """

    t_s: np.ndarray
    ctrl: np.ndarray
    qpos: np.ndarray
    qvel: np.ndarray | None = None
    joints: Sequence[str] | None = None
    actuators: Sequence[str] | None = None
    name: str = field(default="log", kw_only=True)
    begins: tuple[int, ...] = field(default=(0,), kw_only=True)

    def __post_init__(self) -> None:
        self._hold("t_s", np.asarray(self.t_s, float).reshape(-1))
        for what in ("ctrl", "qpos", "qvel"):
            if getattr(self, what) is not None:
                self._hold(what, self._table(what, getattr(self, what)))
        self._check_stamps()
        for what, names in (("qpos", self.joints), ("ctrl", self.actuators)):
            count = getattr(self, what).shape[1]
            if names is not None and len(names) != count:
                raise LogError(
                    f"{self.name}: {what} has {count} columns, and there are {len(names)} names "
                    "for them; give one for each."
                )

    def _hold(self, what: str, value: np.ndarray) -> None:
        object.__setattr__(self, what, value)

    def _table(self, what: str, given: ArrayLike) -> np.ndarray:
        """(N, K) of an array of one column or several.

        Raises:
            LogError: it has not as many rows as there are stamps, or something is no number.
        """
        value = np.asarray(given, float)
        value = value[:, None] if value.ndim == 1 else value
        if value.ndim != 2 or len(value) != len(self.t_s):
            raise LogError(
                f"{self.name}: {what} is of shape {np.shape(given)}, and there are "
                f"{len(self.t_s)} stamps; it needs one row for each."
            )
        bad = np.flatnonzero(~np.isfinite(value).all(axis=1))
        if len(bad):
            raise LogError(
                f"{self.name}: {what} is no number in {len(bad)} of {len(value)} rows, first at "
                f"{self.t_s[bad[0]]:g} s; leave such rows out: a gap is understood."
            )
        return value

    def _check_stamps(self) -> None:
        """Raises LogError where stamps do not ascend, or are too few."""
        if len(self.t_s) < FEWEST:
            raise LogError(
                f"{self.name}: has {len(self.t_s)} samples, and {FEWEST} are the fewest that say "
                "anything; record for longer."
            )
        back = np.flatnonzero(~(np.diff(self.t_s) > 0))
        if len(back):
            raise LogError(
                f"{self.name}: stamps do not ascend in {len(back)} places, first from "
                f"{self.t_s[back[0]]:g} s to {self.t_s[back[0] + 1]:g} s; sort the rows, and leave "
                "out what is there twice."
            )

    @property
    def runs(self) -> list[slice]:
        """Samples of each run."""
        return [slice(a, b) for a, b in pairwise([*self.begins, len(self.t_s)])]

    @property
    def since_s(self) -> np.ndarray:
        """(N,) time of each sample since its run began."""
        return np.concatenate([self.t_s[run] - self.t_s[run.start] for run in self.runs])

    @property
    def period_s(self) -> float:
        """Usual time between two samples, of the slowest run."""
        return max(self._period_s(run) for run in self.runs)

    def _period_s(self, run: slice) -> float:
        return float(np.median(np.diff(self.t_s[run])))

    @property
    def duration_s(self) -> float:
        """Length of all runs together."""
        return float(sum(np.ptp(self.t_s[run]) for run in self.runs))

    def __repr__(self) -> str:
        joints, acts = self.qpos.shape[1], self.ctrl.shape[1]
        counts = f"{counted(joints, 'joint')}, {counted(acts, 'actuator')}"
        return f"JointLog({self.name}: {counts}, {self.duration_s:.0f} s)"

    @property
    def stretches(self) -> list[slice]:
        """Samples of a run that follow each other without a gap."""
        found = []
        for run in self.runs:
            far = np.diff(self.t_s[run]) > GAP * self._period_s(run)
            edges = [run.start, *(run.start + 1 + np.flatnonzero(far)), run.stop]
            found += [slice(int(a), int(b)) for a, b in pairwise(edges)]
        return found

    def ordered(self, joints: Sequence[str], actuators: Sequence[str]) -> "JointLog":
        """With the columns of a model, in its order.

        Raises:
            LogError: a joint or actuator of the model is missing, or one is not the model's.
        """
        q = self._order("joint", self.joints, joints, self.qpos.shape[1])
        u = self._order("actuator", self.actuators, actuators, self.ctrl.shape[1])
        return replace(
            self,
            ctrl=self.ctrl[:, u],
            qpos=self.qpos[:, q],
            qvel=None if self.qvel is None else self.qvel[:, q],
            joints=tuple(joints),
            actuators=tuple(actuators),
        )

    def _order(
        self, what: str, own: Sequence[str] | None, wanted: Sequence[str], count: int
    ) -> list[int]:
        if own is None:
            if count != len(wanted):
                raise LogError(
                    f"{self.name}: has {count} {what}s, and the model {len(wanted)} "
                    f"({', '.join(wanted)}); name those of the log, and leave none out."
                )
            return list(range(count))
        for name in own:
            if name not in wanted:
                near = get_close_matches(name, wanted, n=1, cutoff=0)
                raise LogError(
                    f"{self.name}: the model has no {what} '{name}'; "
                    f"the nearest is '{near[0] if near else 'none'}'."
                )
        missing = [name for name in wanted if name not in own]
        if missing:
            raise LogError(
                f"{self.name}: {what} '{missing[0]}' of the model is not in the log; record all "
                f"{what}s, or take it out of the model."
            )
        return [list(own).index(name) for name in wanted]

    def saved(self, path: Path) -> None:
        """Writes arrays and names as npz."""
        names = {"joints": self.joints, "actuators": self.actuators, "begins": self.begins}
        given: dict[str, Any] = {
            "t_s": self.t_s,
            "ctrl": self.ctrl,
            "qpos": self.qpos,
            "qvel": self.qvel,
            **names,
        }
        with Path(path).open("wb") as stream:
            np.savez(stream, **{key: v for key, v in given.items() if v is not None})


def joined(logs: Sequence[JointLog]) -> JointLog:
    """Runs of one machine as one log, one after the other, each begun with its first command held.

    Args:
        logs: with the columns of one model, in its order.
    """
    if len(logs) == 1:
        return logs[0]
    t_s: list[np.ndarray] = []
    begins, count = list[int](), 0
    for log in logs:
        start_s = t_s[-1][-1] + APART_S if t_s else 0.0
        t_s.append(log.t_s - log.t_s[0] + start_s)
        begins += [count + k for k in log.begins]
        count += len(log.t_s)
    ctrl = np.concatenate([log.ctrl for log in logs])
    for first in begins[1:]:  # a run's last command acts on nothing but the pause behind it
        ctrl[first - 1] = ctrl[first]
    speeds = [log.qvel for log in logs if log.qvel is not None]
    return replace(
        logs[0],
        t_s=np.concatenate(t_s),
        ctrl=ctrl,
        qpos=np.concatenate([log.qpos for log in logs]),
        qvel=np.concatenate(speeds) if len(speeds) == len(logs) else None,
        name=", ".join(dict.fromkeys(log.name for log in logs)),
        begins=tuple(begins),
    )
