# SPDX-License-Identifier: Apache-2.0
"""What `import twinmill as tm` gives: logs, models, and what one tells of the other.

Lengths in m, angles in rad, times in s; frames, signs and clocks as in the page Conventions. The
example of a method goes on where that of its class, or of the function that made it, ends. All
functions leave their arguments and the disk as they are: a fit returns a new `Model`, which
`Model.save` writes. An argument of another kind than is asked for is a TypeError.

Notebooks show what `plot` returns. In a script `matplotlib.pyplot.figure(result.plot())` and then
`matplotlib.pyplot.show()` open a window, and `result.plot().savefig("plot.png")` writes a file.

Objects cannot be pickled: give paths to other processes, and let them return what `to_json` or
`table` gives.
"""

import html
import shutil
import subprocess
import weakref
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from importlib.metadata import version
from io import StringIO
from numbers import Integral, Real
from pathlib import Path
from tempfile import TemporaryDirectory
from types import NoneType
from typing import Any, TypeVar

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from rich.console import Console, RenderableType
from threadpoolctl import threadpool_limits

from twinmill import report
from twinmill.arguments import checked, in_python, known
from twinmill.data.log import Log as RecordedLog
from twinmill.data.log import LogError, RobotLog, read_log
from twinmill.data.measurement import Measurements, load_measurements
from twinmill.data.multi_log import read_multi_log
from twinmill.data.steady_table import INPUTS, SteadyTable, is_steady_table, read_steady_tables
from twinmill.defaults import DEFAULT_MODEL
from twinmill.diagnosis import diagnose as _diagnose
from twinmill.diagnosis.finding import Finding as _Found
from twinmill.diagnosis.finding import Ranked
from twinmill.files import check_new_folder, plain, replacing
from twinmill.fitting import add as _add
from twinmill.fitting import compare as _compare
from twinmill.fitting import fit as _fit
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import catalogue
from twinmill.programs import find_program
from twinmill.report import comparisons, detections, error_figures, show, steady
from twinmill.report import diagnosis as diagnosis_report
from twinmill.report.canvas import draw
from twinmill.report.log_figures import Drawing
from twinmill.swarm.metrics import swarm_metrics

WIDEST_COLUMNS = 100  # of a printed result; text in longer lines is hard to read
A_PATH = "the path of a file"
NOT_WRITTEN = "Not written yet: `model.save(path)` of this result does that."
Result = TypeVar("Result")
Shown = TypeVar("Shown", bound="_Shown")

# The threads of a BLAS wait in loops: on matrices as narrow as ours, two take many times the
# processor time of one where other programs run, and are no sooner done.
_one_thread = threadpool_limits.wrap(limits=1, user_api="blas")


class _Shown:
    """What all results share: one line, a table for notebooks, text for terminals, JSON.

    Attributes:
        left_out: sentences on robots and logs that could not be judged, and on what else is odd.
    """

    _result: Any
    left_out: tuple[str, ...] = ()

    def to_json(self) -> dict:
        """The same object as `--json` of the command, without how the command was called.

        Returns:
            As the page Files tells; an absent number is None, so that JSON can hold all of it.

        Examples:
            >>> found.to_json()["score"] == found.score
            True
        """
        return plain(self._result.to_json())

    def table(self) -> pd.DataFrame:
        """The numbers; each class says which."""
        raise NotImplementedError

    def _text(self) -> RenderableType:
        return repr(self)

    def __str__(self) -> str:
        out = StringIO()
        lines = [f"! {said}" for said in self.left_out]
        width = min(shutil.get_terminal_size().columns, WIDEST_COLUMNS)
        Console(file=out, width=width, color_system=None).print(
            *lines, self._text(), sep="\n", markup=False, highlight=False
        )
        return "\n".join(map(str.rstrip, out.getvalue().splitlines())).rstrip()

    def __reduce__(self) -> str:
        raise TypeError(
            f"{type(self).__name__}: cannot be pickled; give paths to other processes, and return "
            "what to_json() or table() gives."
        )

    def _repr_html_(self) -> str:
        return f"<p><b>{html.escape(repr(self))}</b></p>{self.table()._repr_html_()}"


class _Reported(_Shown):
    """A result with a page of its own."""

    def _page(self) -> tuple[report.Section, str]:
        """What is on the page, and the call that made it."""
        raise NotImplementedError

    def report(self, folder: str | Path) -> Path:
        """Writes a page with all tables and figures, as `--out` does.

        Args:
            folder: made if it is not there; an older page in it is replaced.

        Returns:
            Path of the page, folder/index.html.

        Raises:
            ValueError: the folder cannot be written.

        Examples:
            >>> from tempfile import mkdtemp
            >>> found.report(mkdtemp()).name
            'index.html'
        """
        place = _path("folder", folder, "the path of a folder")
        check_new_folder(place)
        section, call = self._page()
        source = report.Provenance(call, f"twinmill {version('twinmill')}", "")
        return report.write_report(place, section.title, source, [section])


class Log(_Shown):
    """One recorded run, or several: what robots were told, and where they were.

    Of a steady-state table `table` gives the rows; it has no commands, paths or swarm.

    Attributes:
        paths: the files of the runs.

    Examples:
        >>> log = tm.load("run.lcmlog")
        >>> log
        Log(run.lcmlog: robot 0, 60 s)
        >>> list(log.table().columns)
        ['log', 'robot_id', 't_s', 'x_m', 'y_m', 'theta_rad', 'valid']
    """

    def __init__(
        self,
        paths: Iterable[str | Path],
        said: Iterable[str] = (),
        forget: Callable[[], None] = lambda: None,
    ):
        several = checked("paths", paths, (list, tuple), "a list of paths; `load` takes names")
        self.paths = [_path("log", path, A_PATH) for path in several]
        weakref.finalize(self, forget)  # removes the file of a simulated run
        self._said = list(said)  # by the twin
        self._measurements: dict[str, Measurements] = {}  # by the model's hash
        tables = filter(is_steady_table, self.paths)
        self._sheets = [sheet for path in tables for sheet in read_steady_tables(path)]
        self._logs = [read_log(path) for path in self.paths if not is_steady_table(path)]

    def measurements(self, model: "Model | str | Path | None" = None) -> Measurements:
        """Cleaned runs, one for each robot in each log.

        Args:
            model: tells what commands do, so that they are checked against the motion; compare,
                fit, add and diagnose give theirs. None: they are not checked.

        Returns:
            A list of runs; its `findings` say what is wrong with the others.

        Raises:
            BadInputError: all logs are unusable; the message says why.
            LogError: a run is shorter than 10 s.

        Examples:
            >>> [run.label for run in tm.load("run.lcmlog").measurements()]
            ['run.lcmlog R00']
        """
        model = None if model is None else _model(model)
        key = model.file.hash if model else ""
        if key not in self._measurements:
            self._measurements[key] = load_measurements(
                self.paths, model.file.model if model else None
            )
        return self._measurements[key]

    @property
    def robots(self) -> list[int]:
        """Numbers of all robots in the logs.

        Examples:
            >>> tm.load("run.lcmlog").robots
            [0]
        """
        recorded = {number for log in self._logs for number in log.robots}
        return sorted(recorded | {sheet.robot_id for sheet in self._sheets})

    @property
    def duration_s(self) -> float:
        """Length of the longest log.

        Examples:
            >>> tm.load("run.lcmlog").duration_s > 59
            True
        """
        ends = [
            r.pose_t_s[-1] for log in self._logs for r in log.robots.values() if r.pose_t_s.size
        ]
        return float(max(ends, default=0.0))

    @property
    def warnings(self) -> list[str]:
        """Sentences on what is odd in the files, or that the twin said of a simulated run.

        Examples:
            >>> tm.load("run.lcmlog").warnings
            []
        """
        return [*self._said, *(text for log in self._logs for text in log.warnings)]

    def table(self) -> pd.DataFrame:
        """All measured poses, as they were recorded.

        Returns:
            log, robot_id, t_s (motion capture's clock), x_m, y_m, theta_rad (unwrapped), valid; NaN
            where a pose is not valid. If all are steady-state tables: log, robot_id, speed_input,
            direction_deg, turn_input, runs, and medians over runs of speed_mps and turn_radps.

        Examples:
            >>> set(tm.load("run.lcmlog").table()["log"])
            {'run.lcmlog'}
        """
        if not self._logs:
            return pd.concat(map(_steady_rows, self._sheets), ignore_index=True)
        return _rows(self._logs, _poses)

    def commands(self) -> pd.DataFrame:
        """All commands, as they were recorded.

        Returns:
            log, robot_id, t_s (robot's clock), kind, c0 to c3: duty as a fraction or speed in rad/s
            of the wheels front-left, front-right, rear-left, rear-right; or vx_mps, vy_mps,
            omega_radps, 0.

        Raises:
            LogError: all are steady-state tables.

        Examples:
            >>> set(tm.load("run.lcmlog").commands()["kind"])
            {'duty'}
        """
        return _rows(self._recorded("commands"), _commands)

    def metrics(self, model: "Model | str | Path | None" = None) -> pd.DataFrame:
        """What the swarm does over time.

        Args:
            model: whose range of sight and radius of the body scale the metrics.

        Returns:
            log, t_s, the metrics, and class: what the last 10 s look like.

        Raises:
            LogError: a log has not two robots with poses at the same time.

        Examples:
            >>> list(tm.simulate(n=3, duration_s=20).metrics().columns)[:3]
            ['log', 't_s', 'circliness']
        """
        native_model = _model(model).file.model
        scale = native_model.get("sensor.range_m"), native_model.get("robot.body_radius_m")
        parts = []
        for log in self._recorded("swarm"):
            series = swarm_metrics(log, *scale)
            part = pd.DataFrame(series.values, columns=list(series.to_json()["metrics"]))
            part.insert(0, "log", log.path.name)
            part.insert(1, "t_s", series.t_s)
            part["class"] = series.classes
            parts.append(part)
        return pd.concat(parts, ignore_index=True)

    def plot(self) -> Figure:
        """Paths of all robots, seen from above.

        Returns:
            A figure of matplotlib, axes in m of the world frame.

        Raises:
            LogError: all are steady-state tables.

        Examples:
            >>> tm.load("run.lcmlog").plot().axes[0].get_xlabel()
            'x (m)'
        """
        paths = [log.path for log in self._recorded("paths")]
        robots = [robot for path in paths for robot in read_multi_log(path).robots]
        return draw(4.6, Drawing(robots).paths).picture

    def save(self, path: str | Path, force: bool = False) -> None:
        """Copies the log to a file.

        Args:
            path: new file (.lcmlog).
            force: replace it if it is there.

        Raises:
            ValueError: it is there, cannot be written, or these are several logs.

        Examples:
            >>> from tempfile import mkdtemp
            >>> log.save(Path(mkdtemp()) / "kept.lcmlog")
        """
        if len(self.paths) > 1:
            raise ValueError(f"{path}: one file cannot hold {len(self.paths)} logs; save each.")
        with _replacing(path, force) as temporary:
            temporary.write_bytes(self.paths[0].read_bytes())

    def to_json(self) -> dict:
        """What the log holds, in numbers and names.

        Returns:
            paths, robots, duration_s, warnings.

        Examples:
            >>> tm.load("run.lcmlog").to_json()["robots"]
            [0]
        """
        return {
            "paths": [str(path) for path in self.paths],
            "robots": self.robots,
            "duration_s": self.duration_s,
            "warnings": self.warnings,
        }

    def _recorded(self, wanted: str) -> list[RecordedLog]:
        """The logs that are no tables, if there is one."""
        if not self._logs:
            name = self.paths[0].name
            raise LogError(f"{name}: is a steady-state table, which has no {wanted}; give a log.")
        return self._logs

    def __repr__(self) -> str:
        names = ", ".join(path.name for path in self.paths)
        plural = "s" if len(self.robots) > 1 else ""
        numbers = ", ".join(map(str, self.robots))
        length = f"{self.duration_s:.0f} s" if self._logs else "steady-state table"
        return f"Log({names}: robot{plural} {numbers}, {length})"


class Model(_Shown):
    """A robot's model: base, camera and effects, as a model file holds them. It never changes.

    Examples:
        >>> model = tm.Model.load("turbopi.toml")
        >>> model
        Model(turbopi.toml: duty, no effects)
        >>> model["robot.wheel_radius_m"]
        0.0325
    """

    def __init__(self, file: ModelFile):
        self._file = checked("file", file, ModelFile, "a model file; `Model.load` takes its name")

    @classmethod
    def load(cls, name: str | Path = DEFAULT_MODEL) -> "Model":
        """Reads a model file, here or among the installed models.

        Args:
            name: path, or name of an installed model; `.toml` may be left out.

        Returns:
            The model; a file that is missing or wrong is refused before anything else is done.

        Raises:
            ModelError: there is no such file, or it is no valid model; one sentence.

        Examples:
            >>> tm.Model.load("turbopi.toml").effects
            []
        """
        return cls(ModelFile.load(str(checked("model", name, (str, Path), "the name of a model"))))

    @property
    def file(self) -> ModelFile:
        """Its text, its hash and the twin's own object.

        Examples:
            >>> tm.Model.load("turbopi.toml").file.path.name
            'turbopi.toml'
        """
        return self._file

    @property
    def name(self) -> str:
        """Of its file; of a model that was not saved, what it was made from.

        Examples:
            >>> tm.Model.load("turbopi.toml").name
            'turbopi.toml'
        """
        return self.file.path.name

    @property
    def effects(self) -> list[str]:
        """Names of its effects in their order.

        Examples:
            >>> tm.Model.load("hidden.toml").effects
            ['coasting']
        """
        return list(self.file.model.effects)

    def __getitem__(self, quantity: str) -> float:
        """A quantity by its full name, as `base.motor_lag_s` or `coasting.deceleration_mps2`.

        Raises:
            ValueError: the model has none of that name; the sentence has the nearest.
        """
        (name,) = known("quantity", (quantity,), {v["name"] for v in self.file.model.values()})
        return self.file.model.get(name)

    def table(self) -> pd.DataFrame:
        """All quantities of base, camera and effects.

        Returns:
            name, unit, value, neutral (nothing happens), default, min, max and usual_size (all in
            the unit), held (no fit moves it), stage (where it acts), role, place_like, above and
            below (what a value on either side of neutral does), doc.

        Examples:
            >>> table = tm.Model.load("turbopi.toml").table().set_index("name")
            >>> table.loc["base.motor_lag_s", "unit"]
            's'
        """
        return pd.DataFrame(self.file.model.values())

    def to_json(self) -> dict:
        """What the model holds.

        Returns:
            name, sha256 of its text, effects, values by full name (units as of `table`).

        Examples:
            >>> tm.Model.load("turbopi.toml").to_json()["values"]["robot.wheel_radius_m"]
            0.0325
        """
        values = {v["name"]: v["value"] for v in self.file.model.values()}
        return plain(
            {
                "name": self.name,
                "sha256": self.file.hash,
                "effects": self.effects,
                "values": values,
            }
        )

    def save(self, path: str | Path, force: bool = False) -> None:
        """Writes the model file, whole or not at all.

        Args:
            path: new file (.toml).
            force: replace it if it is there.

        Raises:
            ValueError: it is there, or cannot be written.

        Examples:
            >>> tm.Model.load("fitted.toml").save("fitted.toml")
            Traceback (most recent call last):
            ValueError: fitted.toml: exists; choose another name, or replace it with force=True.
        """
        with _replacing(path, force) as temporary:
            temporary.write_text(self.file.text)

    def compare(self, log: "Log | str | Path") -> "Comparison":
        """Tells how well the model predicts a log.

        Args:
            log: a log, or the path of one.

        Returns:
            As `compare`, which says more.

        Raises:
            LogError: the log cannot be used; one sentence.

        Examples:
            >>> tm.Model.load("turbopi.toml").compare("run.lcmlog").score > 1.3
            True
        """
        return compare(log, self)

    def fit(self, log: "Log | str | Path") -> "Fit":
        """Fits all free quantities of the model to a log.

        Args:
            log: a log, or the path of one.

        Returns:
            As `fit`, which says more.

        Raises:
            LogError: the log cannot be used; one sentence.

        Examples:
            >>> tm.Model.load("turbopi.toml").fit("run.lcmlog").model.name
            'turbopi_fitted.toml'
        """
        return fit(log, self)

    @_one_thread
    def add(
        self, effect: str, log: "Log | str | Path", robot: int | None = None, **texts: str
    ) -> "Addition":
        """Adds an effect, fits it with all the rest, and judges it on data it was not fitted to.

        Args:
            effect: name from the catalogue; of one robot also `gains`.
            log: what it is fitted to.
            robot: number of the robot that alone has it; by default all have.
            texts: of the effect `equation`: adds_to, formula and state_rate.

        Returns:
            Scores without and with the effect, and the new model.

        Raises:
            ValueError: there is no such effect, a text makes no sense, or it is of the camera and
                to be one robot's.

        Examples:
            >>> added = tm.Model.load("turbopi.toml").add("coasting", "run.lcmlog")
            >>> added.model.effects
            ['coasting']
            >>> added.heldout_after < added.heldout_before
            True
        """
        checked("robot", robot, (Integral, NoneType), "the number of a robot")
        own = () if robot is None else (_add.OWN_GAINS,)
        known("effect", (effect,), {*catalogue(), *own})
        for key, text in texts.items():
            checked(key, text, str, "a text of the effect `equation`; numbers are fitted")
        measurements = _log(log).measurements(self)
        name = f"{self.file.path.stem}+{effect}.toml"
        command = f"twinmill.add {effect}"
        result, file = _made(
            name,
            lambda out: _add.add(
                effect,
                measurements,
                self.file,
                out=out,
                command=command,
                texts=texts,
                robot_id=None if robot is None else int(robot),
            ),
        )
        return _told(Addition(result, Model(file)), measurements)

    def diagnose(self, log: "Log | str | Path", **options: Any) -> "Diagnosis":
        """Names the physical effect that the model lacks.

        Args:
            log: a log, or the path of one.
            options: as of `diagnose`, which says more.

        Returns:
            As `diagnose`.

        Raises:
            LogError: the log cannot be used; one sentence.
            ValueError: there is no such effect as is named in `without`.

        Examples:
            >>> d = tm.Model.load("fitted.toml").diagnose("run.lcmlog", without=["coasting"])
            >>> "coasting" in [finding.effect for finding in d.found]
            False
        """
        return diagnose(log, self, **options)

    def __repr__(self) -> str:
        effects = ", ".join(self.effects) or "no effects"
        return f"Model({self.name}: {self.file.model.drive}, {effects})"


class Comparison(_Reported):
    """How well a model predicts a log, against the log's own noise.

    Attributes:
        score: root mean square of prediction errors over what noise alone would cause: 1.0 is as
            good as the log can tell; above 1.3 something is missing.
        verdict: what that means, in a sentence.

    Examples:
        >>> found = tm.compare("run.lcmlog", "turbopi.toml")
        >>> found.score > 1.3
        True
    """

    def __init__(self, result: _compare.Comparison):
        self._result = result
        self.score, self.verdict = result.score, result.verdict

    def table(self) -> pd.DataFrame:
        """Errors of each robot in each log.

        Returns:
            log, robot_id, channel, unit, horizon_s, rms, floor (both in the unit), ratio.

        Examples:
            >>> found.table()["horizon_s"].unique().tolist()
            [0.1, 0.2, 0.5, 1.0, 2.0]
        """
        robots = [robot.to_json() for robot in self._result.robots]
        return pd.DataFrame(
            {"log": robot["log"], "robot_id": robot["robot_id"], **row}
            for robot in robots
            for row in robot["errors"]
        )

    def plot(self) -> Figure:
        """Errors over the time predicted ahead, with the noise floor; of a table, its values.

        Of several robots it is the one that the model misses most.

        Returns:
            A figure of matplotlib: m for forward and left, degrees for heading, over s.

        Examples:
            >>> len(found.plot().axes)  # forward, left, heading
            3
        """
        return _errors_drawn([("this model", self._result)])

    def _page(self) -> tuple[report.Section, str]:
        return report.comparison_section(self._result), "twinmill.compare"

    def _text(self) -> RenderableType:
        return show.comparison(self._result)

    def __repr__(self) -> str:
        logs = ", ".join(dict.fromkeys(r.measurement.log_name for r in self._result.robots))
        return f"Comparison({self._result.model_name}, {logs}: score {self.score:.3g})"


class Fit(_Reported):
    """A model fitted to a log.

    Attributes:
        model: the new one.
        before, after: comparisons of both models on the same noise.
        score: of the new model on the log it was fitted to.

    Examples:
        >>> fitted = tm.fit("run.lcmlog", "turbopi.toml")
        >>> fitted.model.effects, fitted.score < fitted.before.score
        ([], True)
    """

    def __init__(self, result: _fit.FitResult, model: Model):
        self._result, self.model = result, model
        self.before, self.after = Comparison(result.before), Comparison(result.after)
        self.score = self.after.score

    def table(self) -> pd.DataFrame:
        """Fitted quantities.

        Returns:
            name, value, std (half a 95 % interval over 1.96), unit, at_bound, seen (false where
            the log does not tell the quantity, and the prior holds it), together (it tells the
            quantity with others, and not alone).

        Examples:
            >>> fitted.table().set_index("name").loc["base.motor_lag_s", "unit"]
            's'
        """
        return pd.DataFrame([e.to_json() for e in self._result.parameters])

    def plot(self) -> Figure:
        """Errors before and after, over the time predicted ahead.

        Returns:
            A figure of matplotlib, as of `Comparison.plot`.

        Examples:
            >>> len(fitted.plot().axes)  # forward, left, heading
            3
        """
        return _errors_drawn([("before", self._result.before), ("after", self._result.after)])

    def compare(self, log: "Log | str | Path") -> Comparison:
        """Compares the fitted model with a log.

        Args:
            log: best another than it was fitted to.

        Returns:
            As `compare`.

        Raises:
            LogError: the log cannot be used; one sentence.

        Examples:
            >>> fitted.compare("run.lcmlog").score < fitted.before.score
            True
        """
        return self.model.compare(log)

    def _page(self) -> tuple[report.Section, str]:
        return report.fit_section(self._result), "twinmill.fit"

    def _text(self) -> RenderableType:
        return show.fit(self._result, NOT_WRITTEN)

    def __repr__(self) -> str:
        name, before = self._result.before.model_name, self.before.score
        return f"Fit({name}: score {before:.3g} -> {self.score:.3g})"


class Addition(_Reported):
    """An effect added to a model.

    Attributes:
        effect: its name, with a number if the model had one already: `dead_zone#2`.
        model: the new model.
        heldout_before, heldout_after: scores on data that was not fitted to, without and with the
            effect, all else refitted.

    Examples:
        >>> added = tm.Model.load("fitted.toml").add("dead_zone", "run.lcmlog")
        >>> added.table()["name"].iloc[-1]
        'dead_zone.width'
    """

    def __init__(self, result: _add.AddResult, model: Model):
        self._result, self.model = result, model
        self.effect = result.effect
        self.heldout_before = result.heldout_refit.score
        self.heldout_after = result.heldout_after.score

    def table(self) -> pd.DataFrame:
        """Fitted quantities.

        Returns:
            name, value, std (half a 95 % interval over 1.96), unit, at_bound, seen (false where
            the log does not tell the quantity, and the prior holds it), together (it tells the
            quantity with others, and not alone).

        Examples:
            >>> list(added.table().columns)[:4]
            ['name', 'value', 'std', 'unit']
        """
        return pd.DataFrame([e.to_json() for e in self._result.parameters])

    def plot(self) -> Figure:
        """Errors before and after; of an effect of the camera, what it sees.

        Returns:
            A figure of matplotlib: as of `Comparison.plot`, or shares over range in m and bearing
            in degrees.

        Examples:
            >>> len(added.plot().axes)  # forward, left, heading
            3
        """
        if self._result.of_camera:
            return detections.field_of_view(self._result.after).svg.picture
        return _errors_drawn([("before", self._result.before), ("after", self._result.after)])

    def _page(self) -> tuple[report.Section, str]:
        return report.added_section(self._result), "twinmill.add"

    def _text(self) -> RenderableType:
        return show.added(self._result, NOT_WRITTEN)

    def __repr__(self) -> str:
        return (
            f"Addition({self.effect}: held out {self.heldout_before:.3g} -> "
            f"{self.heldout_after:.3g})"
        )


class Finding(_Shown):
    """An effect that a model lacks, as a diagnosis found it.

    Attributes:
        effect: its name.
        parameters: estimates by name, with all else that was found.
        share: of the squared error above the noise that it takes away, on data not fitted to.
        certainty: sure, group or doubtful.
        score_heldout: of the model with it, on data that was not fitted to.

    Examples:
        >>> d.best.parameters["deceleration_mps2"] > 0
        True
    """

    def __init__(self, finding: _Found, ranked: Ranked, log: Log):
        self._result, self._ranked, self._log = finding, ranked, log
        self.effect, self.score_heldout = finding.effect, ranked.score_heldout
        self.share, self.certainty = finding.share, finding.certainty
        self.parameters = {e.name.split(".", 1)[-1]: e.value for e in finding.parameters}

    def to_json(self) -> dict:
        """What the diagnosis tells of this effect.

        Returns:
            An entry of findings[] of `twinmill diagnose --json`, and what ranking[] has beside.

        Examples:
            >>> d.best.to_json()["certainty"]
            'sure'
        """
        return plain({**self._ranked.to_json(), **self._result.to_json()})

    def add_to(self, model: Model | str | Path) -> Model:
        """Adds the effect to a model, all fitted to the log of the diagnosis.

        Args:
            model: that lacks it, or the name of one.

        Returns:
            The new model.

        Raises:
            ValueError: the model has the effect already, and that of the diagnosis had not; or the
                effect is made for another drive.

        Examples:
            >>> d.best.add_to(tm.Model.load("fitted.toml")).effects
            ['coasting']
        """
        model, effect = _model(model), self.effect.split("#")[0]
        if effect in model.effects and not self._result.again:
            raise ValueError(
                f"{model.name}: has {effect} already, and the model of the diagnosis had not; fit "
                "this one to the log."
            )
        return model.add(effect, self._log).model

    def table(self) -> pd.DataFrame:
        """Its parameters.

        Returns:
            name, value, std, unit, at_bound, seen, together, as of `Fit.table`.

        Examples:
            >>> d.best.table()["name"].tolist()
            ['coasting.deceleration_mps2', ...]
        """
        return pd.DataFrame([e.to_json() for e in self._result.parameters])

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={value:.3g}" for name, value in self.parameters.items())
        return f"Finding({self.effect}: {values})"


class Diagnosis(_Reported):
    """What a model lacks.

    Attributes:
        verdict: model_adequate, refit_enough, effect_missing, ambiguous, outside_catalogue
            or cannot_tell.
        sentence: the same for people.
        found: the missing effects, most important first.
        best: the first of them; None if none is named.

    Examples:
        >>> d = tm.diagnose("run.lcmlog", "fitted.toml")
        >>> d.verdict
        'effect_missing'
    """

    def __init__(self, result: _diagnose.Diagnosis, log: Log):
        self._result = result
        self.verdict, self.sentence = result.verdict, result.sentence
        ranked = {r.effect: r for r in result.ranking}
        self.found = [
            Finding(result.finding(name), ranked[name], log)
            for name in result.found
            if name in ranked
        ]
        self.best = self.found[0] if self.found else None

    def table(self) -> pd.DataFrame:
        """The effects that explain most, best first.

        Returns:
            effect, found, score_heldout, share_explained, p_value, group (effects of one number
            look alike in this log), takes_away and certainty (of what was found, as `share` and
            `certainty` of `Finding`), estimates (with standard errors; of what was not found, when
            it was tried alone).

        Examples:
            >>> d.table().loc[0, "effect"]
            'coasting'
        """
        keys = ("effect", "score_heldout", "share_explained", "p_value", "group")
        rows = []
        for r in self._result.ranking:
            f = self._result.finding(r.effect)
            rows.append(
                {
                    **{k: getattr(r, k) for k in keys},
                    "takes_away": f.share if f else np.nan,
                    "certainty": f.certainty if f else "",
                    "estimates": diagnosis_report.estimates((f or r).parameters),
                }
            )
        table = pd.DataFrame(rows)
        if len(table):
            table.insert(1, "found", table["effect"].isin(self._result.found))
        return table

    def plot(self) -> Figure:
        """Score after each step: as given, refitted, with each effect found.

        Returns:
            A figure of matplotlib; where robots reported detections, what their cameras see.

        Examples:
            >>> d.plot().axes[0].get_xlabel()
            'score: error over noise floor'
        """
        return diagnosis_report.section(self._result).figures[0].svg.picture

    def _page(self) -> tuple[report.Section, str]:
        return diagnosis_report.section(self._result), "twinmill.diagnose"

    def _text(self) -> RenderableType:
        return diagnosis_report.terminal(self._result)

    def __repr__(self) -> str:
        return f"Diagnosis({self.verdict}: {self.sentence})"


def load(*paths: str | Path) -> Log:
    """Reads logs of the same kind of robot, or steady-state tables (.csv).

    Args:
        paths: LCM logs, as `twinmill import` and twin_run write them.

    Returns:
        All of them together; fits and comparisons take them all.

    Raises:
        LogError: none is named, or a file cannot be read or is no log; one sentence.

    Examples:
        >>> tm.load("run.lcmlog").robots
        [0]
    """
    if not paths:
        raise LogError("load: name one log at least.")
    several = f"{A_PATH}; several are named one by one: load(*paths)"
    return Log([_path("log", path, several) for path in paths])


@_one_thread
def compare(log: Log | str | Path, model: Model | str | Path | None = None) -> Comparison:
    """Tells how well a model predicts a log.

    Predictions start from measured poses and are judged 0.1, 0.2, 0.5, 1 and 2 s later.

    Args:
        log: a log, or the path of one.
        model: a model, or the name of one; None is TurboPi's.

    Returns:
        The score with its errors, floors and regimes, of each robot.

    Raises:
        LogError: the log cannot be judged; one sentence.
        ModelError: the model cannot be read.

    Examples:
        >>> found = tm.compare("run.lcmlog", "turbopi.toml")
        >>> found.verdict
        'Something is missing in the model, or its parameters are stale.'
        >>> list(found.table().columns)
        ['log', 'robot_id', 'channel', 'unit', 'horizon_s', 'rms', 'floor', 'ratio']
    """
    model = _model(model)
    measurements = _log(log).measurements(model)
    return _told(Comparison(_compare.compare(measurements, model.file)), measurements)


@_one_thread
def fit(log: Log | str | Path, model: Model | str | Path | None = None) -> Fit:
    """Fits all free quantities of a model, and the parameters of its effects, to a log.

    Args:
        log: a log, or the path of one.
        model: where the fit begins; a model, or the name of one; None is TurboPi's.

    Returns:
        The new model, its parameters with uncertainties, and both comparisons.

    Raises:
        LogError: the log cannot be used; one sentence.
        ModelError: the model cannot be read.

    Examples:
        >>> fitted = tm.fit("run.lcmlog", "turbopi.toml")
        >>> fitted.score <= fitted.before.score
        True
        >>> list(fitted.table().columns)
        ['name', 'value', 'std', 'unit', 'at_bound', 'seen', 'together']
    """
    start = _model(model)
    measurements = _log(log).measurements(start)
    result, file = _made(
        f"{start.file.path.stem}_fitted.toml",
        lambda out: _fit.fit(measurements, start.file, out, "twinmill.fit"),
    )
    return _told(Fit(result, Model(file)), measurements)


@_one_thread
def diagnose(
    log: Log | str | Path,
    model: Model | str | Path | None = None,
    *,
    without: Iterable[str] = (),
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Names the physical effect that a model lacks, or says that none is, or that none can be told.

    Args:
        log: a log, or the path of one.
        model: best one that was fitted to another log; None is TurboPi's.
        without: names of effects that are not considered.
        progress: is told in words what is being done.

    Returns:
        The verdict, what was found, and all effects that were tried.

    Raises:
        LogError: the log cannot be used; one sentence.
        ModelError: the model cannot be read.
        ValueError: there is no such effect as is named in `without`.

    Examples:
        >>> d = tm.diagnose("run.lcmlog", "fitted.toml")
        >>> d.best
        Finding(coasting: ...)
        >>> d.best.add_to(tm.Model.load("fitted.toml")).effects
        ['coasting']
    """
    log, model = _log(log), _model(model)
    checked("progress", progress, (Callable, NoneType), "a function that takes a text")
    excluded = known("without", without, catalogue())
    measurements = log.measurements(model)
    result = _diagnose.diagnose(measurements, model.file, progress or (lambda _: None), excluded)
    return _told(Diagnosis(result, log), measurements)


def simulate(
    model: Model | str | Path | None = None,
    n: int = 8,
    *,
    behavior: str = "milling_cmaes",
    duration_s: float = 60.0,
    plant: str = "planar",
    seed: int = 1,
    script: str | Path | None = None,
) -> Log:
    """Lets robots drive in the twin.

    Args:
        model: a model, or the name of one; None is TurboPi's.
        n: number of robots.
        behavior: of all of them, or as `milling:5,self_centering:1`.
        duration_s: simulated time.
        plant: `planar`, or `mujoco` with contacts and rollers.
        seed: the same seed gives the same log.
        script: CSV of inputs or duties that all play in place of a behaviour.

    Returns:
        A log like a robot's own; its file goes with the object unless it is saved.

    Raises:
        ModelError: the model cannot be read.
        ValueError: the twin refuses a value; its own sentence.

    Examples:
        >>> swarm = tm.simulate(n=3, duration_s=20)
        >>> swarm.robots
        [0, 1, 2]
        >>> swarm.metrics().shape[0] > 0
        True
    """
    checked("n", n, Integral, "a whole number")
    checked("behavior", behavior, str, "the name of a behaviour, or a mix of them")
    checked("duration_s", duration_s, Real, "a number of seconds")
    checked("plant", plant, str, "`planar` or `mujoco`")
    checked("seed", seed, Integral, "a whole number")
    if script is not None:
        script = _path("script", script, "the path of a CSV file")
    file = _model(model).file
    played = ["--behavior", behavior] if script is None else ["--script", script.resolve()]
    options = ["--plant", plant, "--n", n, "--seed", seed, "--duration-s", duration_s, *played]
    with ExitStack() as stack:
        folder = TemporaryDirectory(prefix="twinmill.", ignore_cleanup_errors=True)
        place = Path(stack.enter_context(folder))
        (place / "model.toml").write_text(file.text)
        said = _run_twin(place, options)
        return Log([place / "simulated.lcmlog"], said, stack.pop_all().close)


def _run_twin(place: Path, options: list) -> list[str]:
    """Writes simulated.lcmlog in a folder, by the model.toml in it; what the twin warned of."""
    command = [
        find_program("twin_run"), "--model", "model.toml", "--log", "simulated.lcmlog", *options,
    ]  # fmt: skip
    done = subprocess.run(
        [str(word) for word in command], cwd=place, capture_output=True, text=True, check=False
    )
    if done.returncode:
        said = done.stderr.strip().removeprefix("twin_run: ") or "twin_run failed."
        raise ValueError(in_python(said))
    return [line.removeprefix("twin_run: ") for line in done.stderr.splitlines()]


def _log(log: Log | str | Path) -> Log:
    log = checked("log", log, (Log, str, Path), f"a log, or {A_PATH}; `load` joins several")
    return log if isinstance(log, Log) else load(log)


def _model(model: Model | str | Path | None) -> Model:
    wanted = "a model, or the name of one"
    model = checked("model", model, (Model, str, Path, NoneType), wanted)
    if isinstance(model, Model):
        return model
    return Model.load(DEFAULT_MODEL if model is None else model)


def _path(name: str, path: Any, wanted: str) -> Path:
    """A path that is none by accident: an empty text would be the working directory."""
    if not str(checked(name, path, (str, Path), wanted)):
        raise ValueError(f"{name}: is empty, and must be {wanted}.")
    return Path(path)


def _told(shown: Shown, measurements: Measurements) -> Shown:
    """The result, with what was found wrong with its logs."""
    mild = [str(f) for f in measurements.findings if not f.fatal]
    shown.left_out = (*measurements.excluded, *mild)
    return shown


@contextmanager
def _replacing(path: str | Path, force: bool) -> Iterator[Path]:
    """As `replacing`, in the words of the library."""
    try:
        with replacing(_path("path", path, A_PATH), force) as temporary:
            yield temporary
    except ValueError as error:
        raise ValueError(in_python(str(error))) from error


def _made(name: str, make: Callable[[Path], Result]) -> tuple[Result, ModelFile]:
    """A result whose model is written to a file that is read back and gone at once."""
    with TemporaryDirectory(prefix="twinmill.") as folder:
        path = Path(folder) / name
        result = make(path)
        file = ModelFile.load(str(path))
    return replace(result, path=Path(name)), replace(file, path=Path(name))


def _poses(robot: RobotLog) -> dict:
    names = ("x_m", "y_m", "theta_rad")
    columns = zip(names, robot.pose.T, strict=True)
    return {"t_s": robot.pose_t_s, **dict(columns), "valid": robot.valid}


def _commands(robot: RobotLog) -> dict:
    columns = {f"c{i}": column for i, column in enumerate(np.atleast_2d(robot.command.T))}
    return {"t_s": robot.command_t_s, "kind": robot.command_kind, **columns}


def _rows(logs: list[RecordedLog], columns: Callable[[RobotLog], dict]) -> pd.DataFrame:
    """One table of all robots in all logs."""
    parts = [
        pd.DataFrame({"log": log.path.name, "robot_id": number, **columns(robot)})
        for log in logs
        for number, robot in log.robots.items()
    ]
    return pd.concat(parts, ignore_index=True)


def _steady_rows(sheet: SteadyTable) -> pd.DataFrame:
    table = pd.DataFrame(sheet.inputs, columns=list(INPUTS))
    table.insert(0, "log", sheet.log_name)
    table.insert(1, "robot_id", sheet.robot_id)
    return table.assign(runs=sheet.runs, speed_mps=sheet.value[:, 0], turn_radps=sheet.value[:, 1])


def _errors_drawn(results: list[tuple[str, _compare.Comparison]]) -> Figure:
    last = results[-1][1]
    if last.shown in (tables := comparisons.steady_comparisons(last)):
        return steady.values(tables).svg.picture
    robot = last.robots.index(last.shown)
    same = [(label, result.robots[robot]) for label, result in results]
    return error_figures.error_growth(same).svg.picture
