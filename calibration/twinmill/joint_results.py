# SPDX-License-Identifier: Apache-2.0
"""Robots of joints in an MJCF: what `tm.diagnose_joints` and its like return, and these functions.

Angles in rad, lengths in m, times in s, commands in the units of the model's `ctrl`. In the
examples `joint_log` is a `tm.JointLog` of 30 s at 100 Hz of a pendulum in the file `pendulum.xml`,
which really has three times the damping that stands there; `d`, `better`, `far` and `motion` are
what `diagnose_joints`, `explain_joints`, `compare_joints` and `next_joints` make of it.
"""

from collections.abc import Callable, Sequence
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from rich.console import RenderableType
from threadpoolctl import threadpool_limits

from twinmill.counted import counted
from twinmill.files import check_new_file, plain, replacing
from twinmill.joints import compare as _compare
from twinmill.joints import diagnose as _diagnose
from twinmill.joints import explain as _explain
from twinmill.joints import next as _next
from twinmill.joints.diagnose import Logs
from twinmill.joints.hook import hook_beside
from twinmill.joints.importers import import_joints as _import
from twinmill.joints.importers.names import Given
from twinmill.joints.log import JointLog
from twinmill.joints.mjcf import Mjcf
from twinmill.report import inference, joints
from twinmill.report.canvas import draw
from twinmill.shown import A_PATH, Shown, path_of

NUMBERS = ["effect", "probability", "certainty", "name", "value", "std", "unit", "held_by"]


class JointDiagnosis(_diagnose.JointDiagnosis, Shown):
    """Answer of a log about an MJCF: what it lacks, with probabilities.

    Attributes:
        answer: `answer.verdict` in a word, `answer.findings` (each with `effect`, `probability`,
            `certainty` and `numbers`: value and standard error by name), `answer.nothing` and
            `answer.outside` (probabilities), `answer.depends_on`.
        mjcf: the model that was judged.
        warnings: what is odd about the log, in sentences.

    Examples:
        >>> d.answer.verdict, d.answer.findings[0].effect
        ('effect_missing', 'viscous_friction@hinge')
    """

    @classmethod
    def of(cls, found: _diagnose.JointDiagnosis) -> "JointDiagnosis":
        """The answer, as it is shown."""
        return cls(**vars(found))

    @property
    def sentence(self) -> str:
        """The verdict for people.

        Examples:
            >>> d.sentence.startswith("Missing: viscous_friction@hinge")
            True
        """
        return inference.sentence(self.answer)

    def to_json(self) -> dict[str, Any]:
        """All numbers and names, as `twinmill diagnose --json` of an MJCF.

        Returns:
            verdict, findings, depends_on and more; an absent number is None.

        Examples:
            >>> d.to_json()["verdict"] == d.answer.verdict
            True
        """
        told: dict[str, Any] = plain(super().to_json())
        return told

    def table(self) -> pd.DataFrame:
        """Numbers of the effects that are missing.

        Returns:
            effect, probability, certainty, name, value, std, unit (of both), held_by (`mjcf`,
            `hook` or None).

        Examples:
            >>> d.table().loc[0, ["name", "unit"]].tolist()
            ['damping', 'N m s/rad']
        """
        rows = [
            (*(f.effect, f.probability, f.certainty), *(name, *number, units[name]), card.held_in)
            for f in self.answer.findings
            for card in [self.problem.effects[f.effect]]
            for units in [{n.key: n.unit for n in card.parameters}]
            for name, number in f.numbers.items()
        ]
        return pd.DataFrame(rows, columns=NUMBERS)

    def plot(self) -> Figure:
        """Probability of each effect, of nothing and of an unknown cause.

        Returns:
            A figure of matplotlib.

        Examples:
            >>> len(d.plot().axes)
            1
        """
        return inference.probabilities(self.answer).svg.picture

    def _text(self) -> RenderableType:
        return joints.diagnosis(self)

    def _above(self) -> tuple[str, ...]:
        return self.warnings

    def __repr__(self) -> str:
        return f"JointDiagnosis({self.mjcf.path.name}: {self.sentence})"


class JointExplanation(_explain.JointExplanation, Shown):
    """An MJCF with what was found.

    Attributes:
        diagnosis: of the log.
        text: of the new MJCF.
        hook: Python text for what MJCF cannot hold; empty where it holds all.
        added: effects that are in the one or the other.
        left_out: effects that are likely, and in neither: they are no force.

    Examples:
        >>> better.added, better.hook
        (('viscous_friction@hinge',), '')
    """

    diagnosis: JointDiagnosis

    @classmethod
    def of(cls, found: _explain.JointExplanation) -> "JointExplanation":
        """The explanation, as it is shown."""
        return cls(**{**vars(found), "diagnosis": JointDiagnosis.of(found.diagnosis)})

    def to_json(self) -> dict[str, Any]:
        """All numbers and names, as `twinmill explain --json` of an MJCF.

        Returns:
            Those of the diagnosis, added and left_out.

        Examples:
            >>> better.to_json()["added"]
            [{'effect': 'viscous_friction@hinge', 'in': 'mjcf'}]
        """
        told: dict[str, Any] = plain(super().to_json())
        return told

    def table(self) -> pd.DataFrame:
        """Numbers of what was missing, as of `JointDiagnosis.table`.

        Examples:
            >>> better.table().equals(better.diagnosis.table())
            True
        """
        return self.diagnosis.table()

    def plot(self) -> Figure:
        """Probabilities, as of `JointDiagnosis.plot`.

        Examples:
            >>> len(better.plot().axes)
            1
        """
        return self.diagnosis.plot()

    def save(self, path: str | Path, force: bool = False) -> list[Path]:
        """Writes the MJCF, and beside it the hook, if there is one.

        Args:
            path: new file (.xml).
            force: replace what is there.

        Returns:
            The files that were written.

        Raises:
            ValueError: one is there, or cannot be written.

        Examples:
            >>> from tempfile import mkdtemp
            >>> [file.name for file in better.save(Path(mkdtemp()) / "better.xml")]
            ['better.xml']
        """
        place = path_of("path", path, A_PATH)
        texts = {place: self.text, **({hook_beside(place): self.hook} if self.hook else {})}
        for file in texts:
            check_new_file(file, force, [])
        for file, text in texts.items():
            with replacing(file, force) as temporary:
                temporary.write_text(text, encoding="utf-8")
        return [*texts]

    def _above(self) -> tuple[str, ...]:
        return self.diagnosis.warnings

    def _text(self) -> RenderableType:
        return joints.explanation(self, {})

    def __repr__(self) -> str:
        added = ", ".join(self.added) or "nothing"
        return f"JointExplanation({self.diagnosis.mjcf.path.name}: {added} added)"


class JointComparison(_compare.JointComparison, Shown):
    """Errors of positions of a log's joints, measured less predicted by stock MuJoCo.

    Attributes:
        joints, units: of the columns.
        window_rms: (J,) over windows of 2 s, each begun from the measured state.
        free_rms: (J,) over the longest stretch of the log, run from its start by commands alone.
        warnings: what is odd about the log, in sentences.

    Examples:
        >>> far
        JointComparison(hinge: ... rad over 2 s, ... rad free)
    """

    def to_json(self) -> dict[str, Any]:
        """All numbers and names, as `twinmill compare --json` of an MJCF.

        Returns:
            joints (each with unit, window_rms, free_run_rms), window_s, warnings.

        Examples:
            >>> far.to_json()["window_s"]
            2.0
        """
        told: dict[str, Any] = plain(super().to_json())
        return told

    def table(self) -> pd.DataFrame:
        """Errors of each joint.

        Returns:
            joint, unit, window_rms, free_rms (both in the unit).

        Examples:
            >>> far.table()["joint"].tolist()
            ['hinge']
        """
        return pd.DataFrame(
            {
                "joint": self.joints,
                "unit": self.units,
                "window_rms": self.window_rms,
                "free_rms": self.free_rms,
            }
        )

    def plot(self) -> Figure:
        """Errors of each joint, over windows and in a free run.

        Returns:
            A figure of matplotlib, in the joints' units.

        Examples:
            >>> far.plot().axes[0].get_ylabel()
            'RMS error'
        """

        def paint(axes: Any) -> None:
            self.table().set_index("joint")[["window_rms", "free_rms"]].plot.bar(ax=axes, rot=0)
            axes.set(xlabel="", ylabel="RMS error")

        return draw(3.0, paint).picture

    def _above(self) -> tuple[str, ...]:
        return self.warnings

    def _text(self) -> RenderableType:
        return joints.comparison(self, None)

    def __repr__(self) -> str:
        told = (
            f"{row.joint}: {row.window_rms:.3g} {row.unit} over {_compare.WINDOW_S:g} s, "
            f"{row.free_rms:.3g} {row.unit} free"
            for row in self.table().itertuples()
        )
        return f"JointComparison({'; '.join(told)})"


class Excitation(_next.Excitation, Shown):
    """A motion for a robot that parts what its logs leave open.

    Attributes:
        diagnosis: that left the questions.
        log: stamps, commands, and the positions that the model takes on them.
        odds, before: expected log odds by pair of names, after this run, and by the logs so far.
        tried, kept: motions that were run, and those within limits.

    Examples:
        >>> motion.table().columns.tolist()
        ['t_s', 'ctrl.motor', 'qpos.hinge']
    """

    diagnosis: JointDiagnosis

    @classmethod
    def of(cls, found: _next.Excitation) -> "Excitation":
        """The motion, as it is shown."""
        return cls(**{**vars(found), "diagnosis": JointDiagnosis.of(found.diagnosis)})

    def to_json(self) -> dict[str, Any]:
        """All numbers and names, as `twinmill next --json` of an MJCF.

        Returns:
            questions, findings, duration_s, tried, within_limits.

        Examples:
            >>> motion.to_json()["duration_s"] <= 10
            True
        """
        told: dict[str, Any] = plain(super().to_json())
        return told

    def table(self) -> pd.DataFrame:
        """The motion; a command holds until the next row.

        Returns:
            t_s, ctrl of each actuator (to be commanded), qpos of each joint (rad or m, expected).

        Examples:
            >>> float(motion.table()["t_s"].iloc[0])
            0.0
        """
        return pd.read_csv(StringIO(self.text()))

    def plot(self) -> Figure:
        """Positions that are expected, over time.

        Returns:
            A figure of matplotlib, in rad or m over s.

        Examples:
            >>> motion.plot().axes[0].get_xlabel()
            't (s)'
        """
        return _positions(self.log, self.mjcf)

    def save(self, path: str | Path, force: bool = False) -> None:
        """Writes the motion as CSV.

        Args:
            path: new file (.csv).
            force: replace it if it is there.

        Raises:
            ValueError: it is there, or cannot be written.

        Examples:
            >>> from tempfile import mkdtemp
            >>> motion.save(Path(mkdtemp()) / "excitation.csv")
        """
        with replacing(path_of("path", path, A_PATH), force) as temporary:
            temporary.write_text(self.text(), encoding="utf-8")

    def _above(self) -> tuple[str, ...]:
        return self.diagnosis.warnings

    def _text(self) -> RenderableType:
        return joints.excitation(self, None, "")

    def __repr__(self) -> str:
        first = min(self.odds, key=self.odds.__getitem__)
        between = " from ".join(name or "nothing" for name in first)
        return f"Excitation({self.log.t_s[-1]:.0f} s, parts {between} last)"


class ImportedJoints(_import.ImportedJoints, Shown):
    """A log that fits a model.

    Attributes:
        log: with the model's names.
        mjcf: the model.
        notes: how it was read and what is odd about it, in sentences.

    Examples:
        >>> read
        ImportedJoints(motion.csv: 1 joint, 1 actuator, 10 s)
    """

    def to_json(self) -> dict[str, Any]:
        """Contents of the log.

        Returns:
            log, joints, actuators, duration_s, notes.

        Examples:
            >>> read.to_json()["joints"]
            ['hinge']
        """
        told: dict[str, Any] = plain(
            {
                "log": self.log.name,
                "joints": [*self.mjcf.joints],
                "actuators": [*self.mjcf.actuators],
                "duration_s": self.log.duration_s,
                "notes": [*self.notes],
            }
        )
        return told

    def table(self) -> pd.DataFrame:
        """Samples of the log.

        Returns:
            t_s, ctrl of each actuator, qpos of each joint (rad or m).

        Examples:
            >>> read.table().columns.tolist()
            ['t_s', 'ctrl.motor', 'qpos.hinge']
        """
        return pd.DataFrame(
            {
                "t_s": self.log.t_s,
                **_columns("ctrl", self.mjcf.actuators, self.log.ctrl),
                **_columns("qpos", self.mjcf.joints, self.log.qpos),
            }
        )

    def plot(self) -> Figure:
        """Positions over time.

        Returns:
            A figure of matplotlib, in rad or m over s.

        Examples:
            >>> len(read.plot().axes)
            1
        """
        return _positions(self.log, self.mjcf)

    def _above(self) -> tuple[str, ...]:
        return self.notes

    def _text(self) -> RenderableType:
        return joints.imported(self, Path(self.log.name))

    def __repr__(self) -> str:
        count = counted(len(self.mjcf.joints), "joint")
        acts = counted(len(self.mjcf.actuators), "actuator")
        return f"ImportedJoints({self.log.name}: {count}, {acts}, {self.log.duration_s:.0f} s)"


def diagnose_joints(
    log: Logs,
    model: Mjcf | Path | str,
    progress: Callable[[str], None] = lambda _: None,
    *,
    own: Logs | None = None,
) -> JointDiagnosis:
    """Probabilities of what an MJCF lacks, from a log of its joints and commands.

    Args:
        log: arrays, or a file of them; or several of one machine, which are judged together.
        model: opened, or its path.
        progress: told in words what is being done.
        own: log, or several, that the model was made with: what it lacks there, too, is no news.

    Returns:
        Verdict, effects with probabilities and numbers, and what the rest depends on.

    Raises:
        LogError: a log does not fit the model, or cannot be read.
        ModelError: the model cannot be loaded, or is of a kind that is not judged.

    Examples:
        >>> print(tm.diagnose_joints(joint_log, "pendulum.xml"))
        Missing: viscous_friction@hinge (...
    """
    with threadpool_limits(1, "blas"):
        return JointDiagnosis.of(_diagnose.diagnose_joints(log, model, progress, own=own))


def explain_joints(
    log: Logs,
    model: Mjcf | Path | str,
    progress: Callable[[str], None] = lambda _: None,
    *,
    own: Logs | None = None,
) -> JointExplanation:
    """Diagnoses, and gives the likeliest model: what is missing, the base's numbers beside it.

    What the model always lacked is missing, too. Of a group that cannot be told apart the likeliest
    is added.

    Args:
        log: arrays, or a file of them; or several of one machine.
        model: opened, or its path.
        progress: told in words what is being done.
        own: as of `diagnose_joints`.

    Returns:
        Texts of the new MJCF and of its hook; `save` writes them.

    Raises:
        LogError: a log does not fit the model, or cannot be read.
        ModelError: the model cannot be loaded or is not judged, or its text is in several files.

    Examples:
        >>> "damping" in tm.explain_joints(joint_log, "pendulum.xml").text
        True
    """
    with threadpool_limits(1, "blas"):
        return JointExplanation.of(_explain.explain_joints(log, model, progress, own=own))


def compare_joints(log: Logs, model: Path | str, hook: Path | str | None = None) -> JointComparison:
    """Runs a log's commands through MuJoCo, and compares positions.

    Args:
        log: arrays, or a file of them; or several of one machine.
        model: path of the MJCF.
        hook: Python file of `explain_joints`, whose forces act as well.

    Returns:
        Errors of each joint, over windows and in a free run.

    Raises:
        LogError: the log does not fit the model, or cannot be read.
        ModelError: the model cannot be loaded, or is of a kind that is not judged.

    Examples:
        >>> tm.compare_joints(joint_log, "pendulum.xml").units
        ('rad',)
    """
    return JointComparison(**vars(_compare.compare_joints(log, model, hook)))


def next_joints(
    logs: Logs,
    model: Mjcf | Path | str,
    *,
    own: Logs | None = None,
    duration_s: float = 30.0,
    times_speed: float = 1.0,
    progress: Callable[[str], None] = lambda _: None,
) -> Excitation:
    """Designs the run that best parts what logs of a machine leave open.

    Args:
        logs: one or several, as of `diagnose_joints`.
        model: opened, or its path.
        own: as of `diagnose_joints`.
        duration_s: of the run.
        times_speed: highest speed of each joint, over that in the logs.
        progress: told in words what is being done.

    Returns:
        The motion, and what it would tell.

    Raises:
        LogError: a log does not fit, nothing is left open, or no motion keeps the limits.
        ModelError: the model cannot be loaded, or is of a kind that is not judged.

    Examples:
        >>> tm.next_joints(joint_log, "pendulum.xml", duration_s=10).kept > 0
        True
    """
    with threadpool_limits(1, "blas"):
        found = _next.next_joints(
            *(logs, model),
            own=own,
            duration_s=duration_s,
            times_speed=times_speed,
            progress=progress,
        )
    return Excitation.of(found)


def import_joints(
    files: Path | str | Sequence[Path | str],
    model: Mjcf | Path | str,
    given: Given = _import.NOTHING_SAID,
    topics: _import.Topics = _import.ANY,
) -> ImportedJoints:
    """Reads files of one machine.

    Args:
        files: one recording, or tables that are parts of one, as positions and commands.
        model: opened, or its path; its joints and actuators are looked for.
        given: names and units that the files do not tell.
        topics: of a bag.

    Returns:
        The log with the model's names; `.log` goes into `diagnose_joints`.

    Raises:
        LogError: a file cannot be read, or does not fit the model.
        MissingExtra: a package is not installed that this kind of file needs.
        ModelError: the model cannot be loaded, or is of a kind that is not judged.

    Examples:
        >>> motion.save("motion.csv", force=True)
        >>> len(tm.import_joints("motion.csv", "pendulum.xml").log.joints)
        1
    """
    return ImportedJoints(**vars(_import.import_joints(files, model, given, topics)))


def _columns(what: str, names: Sequence[str], values: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{what}.{name}": own for name, own in zip(names, values.T, strict=True)}


def _positions(log: JointLog, mjcf: Mjcf) -> Figure:
    """Positions over time, one panel a joint."""

    def paint(axes: Any) -> None:
        every = np.atleast_1d(axes)
        for own, name, unit, q in zip(every, mjcf.joints, mjcf.units, log.qpos.T, strict=True):
            own.plot(log.t_s, q)
            own.set(ylabel=f"{name} ({unit})")
        every[-1].set(xlabel="t (s)")

    count = len(mjcf.joints)
    return draw(0.8 + 1.2 * count, paint, nrows=count, sharex=True).picture
