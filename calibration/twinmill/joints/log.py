# SPDX-License-Identifier: Apache-2.0
"""A run of a jointed robot: stamps, commands to its actuators, positions of its joints."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from twinmill.data.lcm_log import LogError

TIME, POSITION, VELOCITY, COMMAND = "t_s", "qpos.", "qvel.", "ctrl."  # how columns of files begin
FEWEST = 40  # samples: five steps of a joint
GAP = 3.0  # periods between two samples, from which something is missing between them


@dataclass(frozen=True)
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
    """

    t_s: np.ndarray
    ctrl: np.ndarray
    qpos: np.ndarray
    qvel: np.ndarray | None = None
    joints: Sequence[str] | None = None
    actuators: Sequence[str] | None = None
    name: str = field(default="log", kw_only=True)

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
    def period_s(self) -> float:
        """Usual time between two samples."""
        return float(np.median(np.diff(self.t_s)))

    @property
    def stretches(self) -> list[slice]:
        """Samples that follow each other without a gap."""
        cuts = np.flatnonzero(np.diff(self.t_s) > GAP * self.period_s) + 1
        edges = [0, *cuts, len(self.t_s)]
        return [slice(a, b) for a, b in pairwise(edges)]

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
        names = {"joints": self.joints, "actuators": self.actuators}
        given: dict[str, Any] = {
            "t_s": self.t_s,
            "ctrl": self.ctrl,
            "qpos": self.qpos,
            "qvel": self.qvel,
            **names,
        }
        np.savez(path, **{key: v for key, v in given.items() if v is not None})


def read_joint_log(path: Path) -> JointLog:
    """A log in a file: npz with the fields of `JointLog`, or a table of columns named by them.

    A CSV has `t_s`, one column `qpos.NAME` for each joint and one `ctrl.NAME` for each actuator;
    `qvel.NAME` if there are velocities.

    Raises:
        LogError: it cannot be read, or columns are missing.
    """
    path = Path(path)
    try:
        if path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as held:
                return _of_arrays({key: held[key] for key in held.files}, path.name)
        return _of_table(pd.read_csv(path), path.name)
    except (OSError, ValueError, UnicodeDecodeError) as error:
        raise LogError(
            f"{path}: cannot be read as a log of joints ({error}); give npz with t_s, ctrl and "
            "qpos, or CSV with columns t_s, qpos.NAME and ctrl.NAME."
        ) from error


def _of_arrays(held: dict[str, np.ndarray], name: str) -> JointLog:
    for needed in ("t_s", "ctrl", "qpos"):
        if needed not in held:
            raise LogError(f"{name}: has no array '{needed}'; it needs t_s, ctrl and qpos.")
    names = {
        key: tuple(map(str, np.atleast_1d(held[key])))
        for key in ("joints", "actuators")
        if key in held
    }
    return JointLog(held["t_s"], held["ctrl"], held["qpos"], held.get("qvel"), name=name, **names)


def _of_table(table: pd.DataFrame, name: str) -> JointLog:
    if TIME not in table:
        raise LogError(f"{name}: has no column '{TIME}'; its first are {_first(table)}.")
    own = {
        begin: [str(c) for c in table.columns if str(c).startswith(begin)]
        for begin in (POSITION, COMMAND, VELOCITY)
    }
    for begin in (POSITION, COMMAND):
        if not own[begin]:
            raise LogError(
                f"{name}: has no column '{begin}NAME'; its first are {_first(table)}. Rename the "
                "columns after the model's joints and actuators."
            )
    joints = [c.removeprefix(POSITION) for c in own[POSITION]]
    speeds = [VELOCITY + joint for joint in joints]
    return JointLog(
        table[TIME].to_numpy(float),
        table[own[COMMAND]].to_numpy(float),
        table[own[POSITION]].to_numpy(float),
        table[speeds].to_numpy(float) if set(speeds) <= set(table.columns) else None,
        joints,
        [c.removeprefix(COMMAND) for c in own[COMMAND]],
        name=name,
    )


def _first(table: pd.DataFrame) -> str:
    return ", ".join(map(str, table.columns[:6]))
