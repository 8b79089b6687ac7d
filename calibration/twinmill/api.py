# SPDX-License-Identifier: Apache-2.0
"""The library that `import twinmill as tm` gives: logs, models, and comparisons of the two.

Lengths in m, angles in rad, times in s; frames, signs and clocks as in the page Conventions. The
example of a method continues that of its class, or of the function that made the object. Functions
leave their arguments and the disk as they are: a fit returns a new `Model`, which `Model.save`
writes. An argument of a wrong type raises TypeError.

Notebooks show what `plot` returns. In a script `matplotlib.pyplot.figure(result.plot())` and then
`matplotlib.pyplot.show()` open a window, and `result.plot().savefig("plot.png")` writes a file.

Logs, models and results can be pickled, and so be sent to other processes.
"""

import logging
import subprocess
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from importlib.util import find_spec
from numbers import Integral, Real
from pathlib import Path
from tempfile import TemporaryDirectory
from types import NoneType
from typing import Any, ParamSpec, TypeVar, Union

import numpy as np
import pandas as pd
import twinmill_native as native
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from rich.console import RenderableType
from threadpoolctl import threadpool_limits

from twinmill import report
from twinmill.arguments import checked, known
from twinmill.data.importers import import_log as _import
from twinmill.data.importers.from_arrays import (
    MOST_ROBOTS,
    Kind,
    commands_of,
    log_of_frames,
    log_of_series,
    poses_of,
)
from twinmill.data.importers.options import ImportOptions
from twinmill.data.importers.plain import VALUES
from twinmill.data.lcm_log import split_events
from twinmill.data.log import Log as RecordedLog
from twinmill.data.log import LogError, RobotLog, log_of, read_log
from twinmill.data.measurement import Measurement, Measurements, load_measurements
from twinmill.data.multi_log import multi_log_of
from twinmill.data.steady_table import SteadyTable, is_steady_table, read_steady_tables
from twinmill.defaults import (
    ALARM_RATE,
    DEFAULT_MODEL,
    Certainty,
    LogFormat,
    ModelFormat,
    Verdict,
    least_seeds,
)
from twinmill.diagnosis import better as _better
from twinmill.diagnosis import diagnose as _diagnose
from twinmill.diagnosis.better_fleet import better_of_fleet
from twinmill.diagnosis.fleet import Fleet
from twinmill.diagnosis.infer import Inference
from twinmill.estimation.equations import EQUATION
from twinmill.estimation.settings import FIT_SETTINGS, FitSettings
from twinmill.experiment.design import Limits, design, plan_run
from twinmill.experiment.design import check as check_limits
from twinmill.export.carried import open_robot
from twinmill.export.log_files import export_log
from twinmill.export.model_files import export_model
from twinmill.extras import MissingExtra, installing
from twinmill.files import plain, replacing
from twinmill.fitting import add as _add
from twinmill.fitting import compare as _compare
from twinmill.fitting import fit as _fit
from twinmill.fitting import model_comparison as _models
from twinmill.inference import keeping as _keeping
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    catalogue,
    catalogue_name,
    effect_names,
    find_effect,
    key_of,
)
from twinmill.model.python_effect import PythonEffect
from twinmill.model.set_values import with_values
from twinmill.programs import find_program
from twinmill.report import detections, judged, sections, show
from twinmill.report.canvas import draw
from twinmill.report.log_figures import Drawing
from twinmill.report.tables import doubt_of
from twinmill.results import (
    Comparison,
    Effect,
    NextRun,
    RunComparison,
    SwarmComparison,
    errors_drawn,
    residuals_table,
)
from twinmill.runs.compare import compare_runs as _compare_runs
from twinmill.runs.compare import of_robot, right_before
from twinmill.shown import (
    A_PATH,
    Reported,
    Shown,
    path_of,
)
from twinmill.swarm.compare import compare_swarm
from twinmill.swarm.metrics import swarm_metrics

Frame = Any  # a data frame of pandas or polars, a dataset of xarray, a dictionary of arrays
Logs = Union["Log", str, Path, "Sequence[Log | str | Path]"]
LONGEST_RUN_S = 600.0
LEAST_TOP_DUTY = 0.2  # below it no robot on a floor moves
SPREADS = ("idiosyncrasy.theta_a1_std", "idiosyncrasy.theta_a2_std")  # of robots' gains
NAMES = ((list, tuple, set, frozenset), "a list of names")
BY_NAME = (Mapping, "a dictionary by name")
NUMBER = (Real, "a number")
NOT_WRITTEN = "Not written yet: `.model.save(path)` of this result does that."
OF_ROBOTS = ((Real, Mapping), "a number, or a dictionary of numbers by robot")
PAIRS = "a list of pairs of robots, as [(1, 2)]"
SWITCH = (bool, "True or False")
# Options of `import_log`, named as those of `twinmill import` and in its sentences: the field of
# `ImportOptions`, the kinds that it may be of, and these in words.
IMPORT_OPTIONS: dict[str, tuple[str, Any, str]] = {
    "robot": ("robots", *BY_NAME),
    "rename": ("rename", *BY_NAME),
    "exchange": ("exchange", (list, tuple), PAIRS),
    "mapping": ("mapping", (str, Path), A_PATH),
    "flip": ("flips", (*NAMES[0], Mapping), "a list of names, or a dictionary of these by robot"),
    "up": ("up", str, "`x`, `y` or `z`"),
    "pose_shift_s": ("pose_shift_s", *OF_ROBOTS),
    "pose_clock_ppm": ("pose_clock_ppm", *OF_ROBOTS),
    "heading_from_path": ("path_heading", *SWITCH),
    "same_clock": ("same_clock", *SWITCH),
    "pose": ("pose_topics", *NAMES),
    "command": ("command_topics", *NAMES),
    "receive_stamps": ("receive_stamps", *SWITCH),
    "wheelbase_m": ("wheelbase_m", *NUMBER),
    "full_duty": ("full_duty", *NUMBER),
    "wheel_factor": ("wheel_factor", *NUMBER),
    "command_timeout_s": ("command_timeout_s", *NUMBER),
}
Form = TypeVar("Form", bound=StrEnum)
Told = TypeVar("Told", bound="Shown")

Given = ParamSpec("Given")
Result = TypeVar("Result")


LOGGER = logging.getLogger("twinmill")  # progress, and problems of the input
LOGGER.addHandler(logging.NullHandler())


def _one_thread(call: Callable[Given, Result]) -> Callable[Given, Result]:
    """Leaves BLAS one thread meanwhile.

    Its threads wait in loops: on matrices as narrow as ours, two take many times the processor time
    of one where other programs run, and are no sooner done.
    """
    limited: Callable[Given, Result] = threadpool_limits.wrap(limits=1, user_api="blas")(call)
    return limited


class Log(Shown):
    """One recorded run, or several: commands and poses of robots.

    `load` reads files, `from_arrays` and `from_frames` take numbers. `table` gives the rows of a
    steady-state table, which has no commands, paths or swarm.

    Attributes:
        paths: the files of the runs; names of those that are in no file.

    Examples:
        >>> log = tm.load("run.lcmlog")
        >>> log
        Log(run.lcmlog: robot 0, 60 s)
        >>> list(log.table().columns)
        ['log', 'robot_id', 't_s', 'x_m', 'y_m', 'theta_rad', 'valid']
    """

    def __init__(
        self,
        runs: Iterable[RecordedLog],
        tables: Iterable[SteadyTable] = (),
        said: Iterable[str] = (),
    ):
        runs = checked("runs", runs, (list, tuple), "a list of runs; `load` takes names of files")
        self._logs, self._tables = list(runs), list(tables)
        self.paths = [log.path for log in self._logs]
        self.paths += dict.fromkeys(Path(table.log_name) for table in self._tables)
        self._said = list(said)  # by the twin
        self._measurements: dict[str, Measurements] = {}  # by the model's hash

    @classmethod
    def from_arrays(
        cls,
        t_s: ArrayLike,
        pose: ArrayLike,
        commands_t_s: ArrayLike,
        commands: ArrayLike,
        *,
        kind: Kind,
        same_clock: bool = False,
        robot_id: int = 0,
        wheelbase_m: float | None = None,
        name: str = "arrays",
    ) -> "Log":
        """Makes a log of one robot from arrays.

        Args:
            t_s: (N,) times of the poses, s, or numpy's datetime64; ascending.
            pose: (N, 3) x_m, y_m, theta_rad in the world frame, or (N, 2) where no heading was
                measured. Rows with NaN are lost poses.
            commands_t_s: (M,) times of the commands, likewise; each is held until the next.
            commands: (M, K) by `kind`. `twist`: vx_mps, vy_mps, omega_radps, or vx_mps,
                omega_radps. `duty`: percent, and `wheel_speed`: rad/s: two columns are left and
                right (of every axle), three are omni wheels, four are front left, front right,
                rear left, rear right. `steering`: vx_mps, steering_rad.
            kind: of the commands.
            same_clock: one clock stamped poses and commands; False: their offset is fitted, but
                where the model's file has it from another log (`[clock]`).
            robot_id: 0 to 99.
            wheelbase_m: distance of the axles, for `steering`.
            name: of the log in tables and sentences.

        Returns:
            A log; nothing is written.

        Raises:
            LogError: the arrays make no run; one sentence.

        Examples:
            >>> t_s = np.arange(0, 20, 0.05)
            >>> pose = np.column_stack([np.cos(t_s), np.sin(t_s), t_s + np.pi / 2])
            >>> tm.Log.from_arrays(t_s, pose, [0, 10], [[1.0, 1.0], [1.0, 1.0]], kind="twist")
            Log(arrays: robot 0, 20 s)
        """
        _check_arrays(robot_id, wheelbase_m, same_clock=same_clock, name=name)
        poses = poses_of(robot_id, t_s, pose)
        told = commands_of(robot_id, commands_t_s, commands, kind=kind, wheelbase_m=wheelbase_m)
        return cls([log_of_series([poses], [told], name, same_clock)])

    @classmethod
    def from_frames(
        cls,
        poses: Frame,
        commands: Frame,
        *,
        kind: Kind | None = None,
        same_clock: bool = False,
        robot_id: int = 0,
        wheelbase_m: float | None = None,
        name: str = "frames",
    ) -> "Log":
        """Makes a log from data frames of pandas or polars, datasets of xarray, or dictionaries.

        Columns in another unit that their names tell are converted: theta_deg, x_mm, t_ms. Others
        than those below are ignored.

        Args:
            poses: columns t_s (s, or dates), x_m, y_m, and theta_rad, or qw, qx, qy, qz, where
                headings were measured; robot_id where there are several robots; rows where `valid`
                is false, or with NaN, are lost poses.
            commands: columns t_s and one group: vx_mps, omega_radps, and vy_mps where the robot is
                told to drive sideways; fl_pct, fr_pct, rl_pct, rr_pct; left_pct, right_pct (or
                left_pwm ...); w1_radps to w4_radps, the first three of omni wheels, left_radps,
                right_radps (or w1_radps, w2_radps) of two; or vx_mps, steering_rad; robot_id as
                in poses.
            kind: which group; by default the one that is there.
            same_clock: one clock stamped poses and commands; False: their offset is fitted, but
                where the model's file has it from another log (`[clock]`).
            robot_id: of frames that do not say.
            wheelbase_m: distance of the axles, for steering angles.
            name: of the log in tables and sentences.

        Returns:
            A log; nothing is written.

        Raises:
            LogError: a column is missing, or the numbers make no run; one sentence.

        Examples:
            >>> log = tm.load("run.lcmlog")
            >>> tm.Log.from_frames(log.table(), log.commands())
            Log(frames: robot 0, 60 s)
        """
        _check_arrays(robot_id, wheelbase_m, same_clock=same_clock, name=name)
        run = log_of_frames(
            poses,
            commands,
            kind=kind,
            robot_id=robot_id,
            wheelbase_m=wheelbase_m,
            name=name,
            same_clock=same_clock,
        )
        return cls([run])

    @classmethod
    def joined(cls, logs: "Sequence[Log]") -> "Log":
        """Several logs of the same kind of robot as one object, as `load` makes of several files.

        Args:
            logs: one at least; names of two of them should differ.

        Raises:
            LogError: there is none.

        Examples:
            >>> tm.Log.joined([tm.load("run.lcmlog"), tm.simulate(n=2, duration_s=5)]).robots
            [0, 1]
        """
        if not logs:
            raise LogError("log: name one log at least.")
        runs, tables, said = (
            [part for log in logs for part in getattr(log, own)]
            for own in ("_logs", "_tables", "_said")
        )
        return cls(runs, tables, said)

    def measurements(self, model: "Model | str | Path | None" = None) -> Measurements:
        """Cleaned runs, one for each robot in each log.

        Args:
            model: predicts the motion, against which commands are checked; compare, fit, add and
                diagnose give theirs. None: no such check.

        Returns:
            A list of runs; its `findings` describe the problems of the others.

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
                [*self._logs, *self._tables], model.file.model if model else None
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
        return sorted(recorded | {table.robot_id for table in self._tables})

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
        """Warnings about the files, or of the twin about a simulated run.

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
            return pd.concat(map(_steady_rows, self._tables), ignore_index=True)
        return _rows(self._logs, _poses)

    def commands(self) -> pd.DataFrame:
        """All commands that the robots were sent, by their own clock.

        Duties of imported tables and arrays are repeated every 22 ms while they are held, as robots
        tell them: of rows that change nothing there may be more here.

        Returns:
            log, robot_id, t_s (robot's clock), kind, and by kind fl_pct, fr_pct, rl_pct, rr_pct
            (duty); w1_radps to w4_radps (wheel_speed); or vx_mps, vy_mps, omega_radps (twist).

        Raises:
            LogError: all are steady-state tables.

        Examples:
            >>> set(tm.load("run.lcmlog").commands()["kind"])
            {'duty'}
        """
        return _rows(self._recorded("commands"), _commands)

    def to_pandas(self) -> pd.DataFrame:
        """One row per measured pose, with the command that was in force by the stamps.

        Returns:
            The columns of `table`, then those of `commands` from kind on; NaN before the first
            command. Stamps are as recorded: an offset of the clocks is not taken out.

        Raises:
            LogError: all are steady-state tables.

        Examples:
            >>> frame = tm.load("run.lcmlog").to_pandas()
            >>> list(frame.columns)[3:8]
            ['x_m', 'y_m', 'theta_rad', 'valid', 'kind']
        """
        keys = ["log", "robot_id"]
        commands, poses = self.commands().sort_values("t_s"), self.table().sort_values("t_s")
        joined = pd.merge_asof(poses, commands, on="t_s", by=keys)
        return joined.sort_values([*keys, "t_s"], ignore_index=True)

    def to_xarray(self) -> Any:
        """The numbers of `to_pandas` as a dataset of xarray (`pip install xarray`).

        Returns:
            Variables along `t_s` if there is one robot in one log; else along `row`, with the
            coordinates log, robot_id and t_s.

        Raises:
            ModuleNotFoundError: xarray is not installed.

        Examples:
            >>> tm.load("run.lcmlog").to_xarray()["x_m"].dims  # doctest: +SKIP
            ('t_s',)
        """
        if find_spec("xarray") is None:  # which no extra brings: nothing else here takes it
            raise MissingExtra(
                "log.to_xarray() needs the package 'xarray', which is not installed; install it "
                f"with: {installing('xarray')}",
                name="xarray",
            )
        frame = self.to_pandas()
        keys = ["log", "robot_id"]
        dataset = frame.rename_axis("row").to_xarray().set_coords([*keys, "t_s"])
        one = len(frame[keys].drop_duplicates()) == 1
        return dataset.swap_dims(row="t_s").drop_vars("row") if one else dataset

    def metrics(self, model: "Model | str | Path | None" = None) -> pd.DataFrame:
        """Measures of the swarm's behaviour over time.

        Args:
            model: its view range and body radius scale the metrics.

        Returns:
            log, t_s, the metrics, and class: the behaviour over the last 10 s.

        Raises:
            LogError: a log has not two robots with poses at the same time.

        Examples:
            >>> list(tm.simulate(n=3, duration_s=20).metrics().columns)[:3]
            ['log', 't_s', 'circliness']
        """
        twin = _model(model).file.model
        parts = []
        for log in self._recorded("swarm"):
            series = swarm_metrics(log, *_scale(twin))
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
        robots = [
            robot
            for log in self._recorded("paths")
            for robot in multi_log_of(
                split_events(log.read_bytes(), log.path.name), log.path, log.sha256
            ).robots
        ]
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
        (run,) = self._recorded("file of its own")
        with replacing(path_of("path", path, A_PATH), force) as temporary:
            temporary.write_bytes(run.read_bytes())

    def export(
        self,
        path: str | Path,
        to: str,
        *,
        model: "Model | str | Path | None" = None,
        force: bool = False,
    ) -> list[Path]:
        """Writes the log for other programs, whole or not at all.

        Args:
            path: new file (mcap), or new folder (the others).
            to: `mcap` (Foxglove), `rosbag2`, or tables, one file per type of message: `csv`,
                `parquet`.
            model: whose size and range of sight are drawn in Foxglove.
            force: replace what is there.

        Returns:
            The files that were written.

        Raises:
            ValueError: there is no such format, `path` is there or cannot be written, or these are
                several logs.
            LogError: it is a steady-state table.

        Examples:
            >>> from tempfile import mkdtemp
            >>> files = tm.load("run.lcmlog").export(Path(mkdtemp()) / "tables", to="csv")
            >>> "pose.csv" in [file.name for file in files]
            True
        """
        form = _format(to, LogFormat)
        logs, file = self._recorded("messages"), _model(model).file
        if len(logs) > 1:
            raise ValueError(f"{path}: one export cannot hold {len(logs)} logs; export each.")
        done = export_log(
            *(logs[0].path, form, path_of("path", path, A_PATH)),
            model=file.model,
            command="twinmill.Log.export",
            force=force,
            data=logs[0].data,
        )
        return done.files

    def compare_swarm(
        self,
        model: "Model | str | Path | None" = None,
        *,
        n_seeds: int = 50,
        behavior: str | None = None,
    ) -> "SwarmComparison":
        """Tests whether the recorded swarm behaves as the twin's swarms do.

        Paths of a swarm are chaotic, so metrics over time are compared: the recorded run is ranked
        among runs of the twin that start from the same poses.

        Args:
            model: of all robots; a model, or the name of one; None is TurboPi's.
            n_seeds: runs of the twin, 39 at least: fewer cannot reach significance.
            behavior: of all robots; None: as in the log.

        Returns:
            Verdict, p-values and the bands of the twin's runs.

        Raises:
            LogError: these are several logs, or there are not two robots at the same time.
            ValueError: it has less than 4 s of motion, or gaps, after the swarm starts (so short
                a log tells little: a minute is usual); it does not name the behaviour; or there
                are too few runs.

        Examples:
            >>> swarm = tm.simulate(n=3, duration_s=20)
            >>> swarm.compare_swarm(n_seeds=39).table()["metric"].unique().tolist()
            ['circliness', 'radius_m', 'rotation', 'diffusion', 'groups', 'contacts']
        """
        checked("n_seeds", n_seeds, Integral, "a whole number")
        checked("behavior", behavior, (str, NoneType), "the name of a behaviour")
        if n_seeds < least_seeds():
            raise ValueError(f"n_seeds: is {n_seeds}, and must be {least_seeds()} at least.")
        logs, twin = self._recorded("swarm"), _model(model).file.model
        if len(logs) > 1:
            raise LogError(f"compare_swarm: is of one log, and these are {len(logs)}.")
        series = swarm_metrics(logs[0], *_scale(twin))
        seeds = range(1, int(n_seeds) + 1)
        result = compare_swarm(logs[0], series, twin, seeds=seeds, behavior=behavior)
        return SwarmComparison(result)

    def to_json(self) -> dict[str, Any]:
        """Contents of the log, in numbers and names.

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


class Model(Shown):
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
        checked("model", name, (str, Path), "the name of a model")
        return cls(ModelFile.load(str(name)))

    @classmethod
    def from_text(cls, text: str, name: str = "model.toml") -> "Model":
        """Model that a text describes, as a file's would; `save` writes it.

        Args:
            text: TOML.
            name: that results call it by.

        Raises:
            ModelError: it is no valid model; one sentence.

        Examples:
            >>> text = tm.Model.load("turbopi.toml").file.text
            >>> tm.Model.from_text(text, "mine.toml")
            Model(mine.toml: duty, no effects)
        """
        checked("text", text, str, "a model's TOML")
        checked("name", name, str, "the name of a model")
        return cls(ModelFile.of_text(Path(name), text, name))

    @property
    def file(self) -> ModelFile:
        """Source of the model: `path`, `text` (TOML) and `hash` (sha256 of the text).

        Its other attributes are the library's own, and may change.

        Examples:
            >>> tm.Model.load("turbopi.toml").file.path.name
            'turbopi.toml'
        """
        return self._file

    @property
    def name(self) -> str:
        """Name of its file; of a model that was not saved, of the one it was made from.

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

    def to_json(self) -> dict[str, Any]:
        """Contents of the model.

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
        with replacing(path_of("path", path, A_PATH), force) as temporary:
            temporary.write_text(self.file.text)

    def compare(self, log: "Log | str | Path") -> "Comparison":
        """Measures the model's prediction errors on a log.

        Args:
            log: a log, or the path of one.

        Returns:
            See `compare`.

        Raises:
            LogError: the log cannot be used; one sentence.

        Examples:
            >>> tm.Model.load("turbopi.toml").compare("run.lcmlog").score > 1.3
            True
        """
        return compare(log, self)

    def fit(self, log: "Logs", **options: Any) -> "Fit":
        """Fits the model to a log.

        Args:
            log: a log, the path of one, or a list of these.
            options: hold, free, priors and settings of `fit`.

        Returns:
            See `fit`.

        Raises:
            LogError: the log cannot be used; one sentence.

        Examples:
            >>> tm.Model.load("turbopi.toml").fit("run.lcmlog").model.name
            'turbopi_fitted.toml'
        """
        return fit(log, self, **options)

    @_one_thread
    def add(
        self,
        effect: str | PythonEffect,
        log: "Log | str | Path",
        robot: int | None = None,
        **texts: str,
    ) -> "Addition":
        """Adds an effect, fits it with all other parameters, and cross-validates it.

        Args:
            effect: name from the catalogue, with `robot` also `gains`; or an effect made by
                `python_effect`.
            log: data of the fit.
            robot: number of the robot that alone has it; by default all have.
            texts: adds_to, formula, state_rate, second_rate, called and numbers of the effect
                `equation`.

        Returns:
            Scores without and with the effect, and the new model.

        Raises:
            ValueError: there is no such effect, a text cannot be parsed, or an effect of the camera
                was to be one robot's.

        Examples:
            >>> added = tm.Model.load("turbopi.toml").add("coasting", "run.lcmlog")
            >>> added.model.effects
            ['coasting']
            >>> added.heldout_after < added.heldout_before
            True
        """
        checked("robot", robot, (Integral, NoneType), "the number of a robot")
        own = () if robot is None else (_add.OWN_GAINS,)
        name, priors, bounds = effect, None, None
        if isinstance(effect, PythonEffect):
            name, texts = effect.name, effect.texts
            priors, bounds = effect.priors, effect.bounds
            effect = EQUATION
        known("effect", (effect,), {*catalogue(), *own})
        for key, text in texts.items():
            checked(key, text, str, "a text of the effect `equation`; numbers are fitted")
        measurements = _log(log).measurements(self)
        result = _add.add_to_model(
            effect,
            measurements,
            self.file,
            path=Path(f"{self.file.path.stem}+{name}.toml"),
            command=f"twinmill.add {name}",
            texts=texts,
            priors=priors,
            bounds=bounds,
            robot_id=None if robot is None else int(robot),
        )
        result = replace(result, child=_keeping.with_its_error(result.child, measurements))
        return _told(Addition(result), measurements)

    def numbers(self, effect: PythonEffect) -> dict[str, float]:
        """Values of an effect that is written in Python, by its own names of the parameters.

        Raises:
            ValueError: the model does not have it.

        Examples:
            >>> @tm.python_effect("vx_mps", {"drag": tm.Number("s/m", low=0)})
            ... def air(vx, drag):
            ...     return -drag * vx * abs(vx)
            >>> list(tm.Model.load("turbopi.toml").add(air, "run.lcmlog").model.numbers(air))
            ['drag']
        """
        checked("effect", effect, PythonEffect, "an effect made by `python_effect`")
        return {own: self[name] for own, name in effect.names(self.file.model).items()}

    def set(self, values: Mapping[str, float]) -> "Model":
        """Sets parameters by hand; their standard errors from fits are dropped.

        Args:
            values: by full name, in the unit of `table`; six digits are kept.

        Returns:
            The new model; this one stays as it is.

        Raises:
            ModelError: there is no such quantity, or a value is outside its bounds.

        Examples:
            >>> slower = tm.Model.load("turbopi.toml").set({"base.motor_lag_s": 0.09})
            >>> slower["base.motor_lag_s"]
            0.09
        """
        checked("values", values, Mapping, "a dictionary of numbers by name")
        for name, value in values.items():
            checked("values", name, str, "the name of a quantity")
            checked(name, value, Real, "a number")
        text = with_values(self.file, values, "twinmill.Model.set")
        return Model(ModelFile.of(Path(f"{self.file.path.stem}_set.toml"), text))

    def export(
        self,
        path: str | Path,
        to: str,
        *,
        robot: int | None = None,
        ranges: bool = False,
        force: bool = False,
    ) -> list[str]:
        """Writes the model for another simulator, whole or not at all.

        Args:
            path: new file.
            to: `mjcf`, `sdf`, `urdf`, `ros2_control` or `json`, which alone is complete.
            robot: number of the robot whose own parameters are used; None: those of all.
            ranges: write intervals and 100 samples of the fitted numbers, too: files of the same
                name that end in `_ranges.yaml`, `_ranges.json` and `_ranges.npz`.
            force: replace what is there.

        Returns:
            A sentence for each part of the model that the format cannot represent, then warnings
            about the ranges.

        Raises:
            ValueError: there is no such format, a file is there or cannot be written, or the
                format cannot represent this robot at all.

        Examples:
            >>> from tempfile import mkdtemp
            >>> tm.Model.load("turbopi.toml").export(Path(mkdtemp()) / "turbopi.json", to="json")
            []
        """
        form = _format(to, ModelFormat)
        checked("robot", robot, (Integral, NoneType), "the number of a robot")
        out = path_of("path", path, A_PATH)
        done = export_model(
            *(open_robot(self.file, robot, None), form, out),
            ranges_stem=out.with_suffix("") if ranges else None,
            force=force,
        )
        return [*(left.sentence() for left in done.left), *done.warnings]

    def explain(self, log: "Log | str | Path", **options: Any) -> "Explanation":
        """Diagnoses, and adds the effects that are found.

        Args:
            log: a log, or the path of one.
            options: of `explain`.

        Returns:
            See `explain`.

        Raises:
            LogError: the log cannot be used; one sentence.

        Examples:
            >>> tm.Model.load("fitted.toml").explain("run.lcmlog").model.effects
            ['coasting']
        """
        return explain(log, self, **options)

    def next_run(self, log: "Log | str | Path", **options: Any) -> "NextRun":
        """Designs the run that best discriminates between effects that these logs cannot.

        Args:
            log: a log, or the path of one.
            options: of `next_run`.

        Returns:
            See `next_run`.

        Raises:
            LogError: the log cannot be used; one sentence.
            ValueError: no script can be within these limits, or none shows what is in question.

        Examples:
            >>> run = tm.Model.load("fitted.toml").next_run("run.lcmlog", duration_s=20)
            >>> run.duration_s <= 20
            True
        """
        return next_run(log, self, **options)

    def diagnose(self, log: "Log | str | Path", **options: Any) -> "Diagnosis":
        """Names the physical effect that the model lacks.

        Args:
            log: a log, or the path of one.
            options: of `diagnose`.

        Returns:
            See `diagnose`.

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
        logs = self.file.fitted_logs
        fitted = f", fitted to {logs}" if logs else ""
        return f"Model({self.name}: {self.file.model.drive}, {effects}{fitted})"


class Fit(Reported):
    """A model fitted to a log.

    Attributes:
        model: the new one.
        before: comparison of the model as given with the log.
        after: comparison of the new model, on the same noise.
        score: of the new model on the log it was fitted to. It may be higher than before where a
            prior in `priors` holds the model off what the log tells.
        log_likelihood: Gaussian, of errors over the noise floor, maximised over the scale of each
            data set, without priors.
        nobs: number of independent errors, which of a log is counted by time and need not be whole:
            one for 2 s of each channel, fewer where errors are correlated; `residuals` has more
            rows, which overlap.
        converged: the last step lowered the cost by less than the tolerance of `settings`; False:
            its rounds were used up, and more of them may fit better.

    Examples:
        >>> fitted = tm.fit("run.lcmlog", "turbopi.toml")
        >>> fitted.model.effects, fitted.score < fitted.before.score
        ([], True)
    """

    def __init__(self, result: _fit.FitResult):
        self._result, self.model = result, Model(result.child)
        self.before, self.after = Comparison(result.before), Comparison(result.after)
        self.score, told = self.after.score, result.statistics
        self.log_likelihood, self.nobs, self.converged = (
            told.log_likelihood,
            told.nobs,
            told.converged,
        )

    @property
    def params(self) -> pd.Series:
        """Values by name, a series of pandas: estimates, then what was held.

        Each is in the unit that `table` tells: lengths in m, times in s, gains without one. Of what
        was held the standard error is NaN.

        Examples:
            >>> bool(fitted.params["base.motor_lag_s"] > 0)
            True
        """
        every = (*self._result.parameters, *self._result.held)
        return pd.Series({p.name: p.value for p in every}, name="value")

    @property
    def stderr(self) -> pd.Series:
        """Standard errors by name: half a 95 % interval over 1.96.

        From the jackknife over blocks of 8 s, widened by Student's t where blocks are few, and by
        the influence of the usual priors; never above the deviation of a prior in `priors`. All
        tables, files and intervals have these. NaN for what was held: nothing was estimated.

        Examples:
            >>> bool((fitted.stderr**2 - np.diag(fitted.covariance())).abs().max() < 1e-12)
            True
        """
        found = {e.name: e.std for e in self._result.parameters}
        return pd.Series(
            {name: found.get(name, np.nan) for name in self.params.index}, name="stderr"
        )

    def covariance(self) -> pd.DataFrame:
        """Covariance of the estimates, without what was held.

        Returns:
            A square table, in products of the units; the diagonal has `stderr` squared.

        Examples:
            >>> fitted.covariance().shape == (len(fitted.params), len(fitted.params))
            True
        """
        told = self._result.statistics.covariance
        return pd.DataFrame(told.values, index=told.names, columns=told.names)

    def conf_int(self, alpha: float = 0.05) -> pd.DataFrame:
        """Confidence intervals at the level 1 - alpha, by Student's t.

        Args:
            alpha: 0.05 for 95 %.

        Returns:
            lower and upper, by name; NaN for what was held.

        Raises:
            ValueError: alpha is not within 0 to 1.

        Examples:
            >>> bool((fitted.conf_int()["lower"] < fitted.params).all())
            True
        """
        if not 0 < checked("alpha", alpha, *NUMBER) < 1:
            raise ValueError(f"alpha: is {alpha}, and must be within 0 to 1.")
        half = self._result.statistics.half_width(self.stderr, alpha)
        return pd.DataFrame({"lower": self.params - half, "upper": self.params + half})

    def residuals(self) -> pd.DataFrame:
        """Each prediction of the fitted model beside what was measured.

        Returns:
            As of `Comparison.residuals`.

        Examples:
            >>> fitted.residuals()["channel"].unique().tolist()
            ['forward', 'left', 'heading']
        """
        return residuals_table(self._result.statistics.residuals)

    def summary(self) -> str:
        """Estimates with errors and intervals, as text.

        Examples:
            >>> "log-likelihood" in fitted.summary()
            True
        """
        rows = pd.DataFrame({"value": self.params, "stderr": self.stderr})
        rows = rows.join(self.conf_int().set_axis(["[0.025", "0.975]"], axis=1))
        rows["unit"] = [p.unit for p in (*self._result.parameters, *self._result.held)]
        doubts = [*map(doubt_of, self._result.parameters), *("held" for _ in self._result.held)]
        if any(doubts):
            rows[""] = [f"({doubt})" if doubt else "" for doubt in doubts]
        head = {
            "model": self.model.name,
            "score": f"{self.before.score:.3g} -> {self.score:.3g}",
            "held-out score": f"{self._result.heldout.score:.3g}",
            "independent errors": f"{self.nobs:.4g}",
            "log-likelihood": f"{self.log_likelihood:.4g}",
            "converged": "yes" if self.converged else "no",
        }
        lines = [f"{name:20}{value}" for name, value in head.items()]
        text = rows.to_string(float_format="{:.4g}".format, na_rep="")
        return "\n".join([*lines, "", *(line.rstrip() for line in text.splitlines())])

    def table(self) -> pd.DataFrame:
        """Fitted quantities, then those that were held.

        Returns:
            name, value, std (half a 95 % interval over 1.96; NaN where held), unit, at_bound, seen
            (false where the log does not determine the quantity, only its prior), together
            (determined in combination with others, not alone), words (what it is, where the name
            does not say so), prior (true where one was given in `priors`), held.

        Examples:
            >>> fitted.table().set_index("name").loc["base.motor_lag_s", "unit"]
            's'
        """
        rows = [{**e.to_json(), "held": False} for e in self._result.parameters]
        kept = {"std": np.nan, "at_bound": False, "seen": False, "together": False, "prior": False}
        rows += [{**h.to_json(), **kept, "words": h.words, "held": True} for h in self._result.held]
        return pd.DataFrame(rows)

    def plot(self) -> Figure:
        """Errors before and after, over the horizon.

        Returns:
            A figure of matplotlib, as of `Comparison.plot`.

        Examples:
            >>> len(fitted.plot().axes)  # forward, left, heading
            3
        """
        return errors_drawn([("before", self._result.before), ("after", self._result.after)])

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
        return sections.fit_section(self._result), "twinmill.fit"

    def _text(self) -> RenderableType:
        return show.fit(self._result, NOT_WRITTEN)

    def __repr__(self) -> str:
        name, logs = self._result.before.model_name, self.model.file.fitted_logs
        return f"Fit({name}, {logs}: score {self.before.score:.3g} -> {self.score:.3g})"


class Addition(Reported):
    """An effect added to a model.

    Attributes:
        effect: its name, with a number if the model had one already: `dead_zone#2`.
        model: the new model.
        heldout_before, heldout_after: scores on data that was not fitted to, without and with the
            effect, all else refitted in both; lower is better, and 1.0 as good as the log can tell.
            An effect that does not lower it does not belong into the model.

    Examples:
        >>> added = tm.Model.load("fitted.toml").add("dead_zone", "run.lcmlog")
        >>> added.table()["name"].iloc[-1]
        'dead_zone.width'
    """

    def __init__(self, result: _add.AddResult):
        self._result, self.model = result, Model(result.child)
        self.effect = result.effect
        self.heldout_before = result.heldout_refit.score
        self.heldout_after = result.heldout_after.score

    def table(self) -> pd.DataFrame:
        """Fitted quantities.

        Returns:
            name, value, std (half a 95 % interval over 1.96), unit, at_bound, seen (false where
            the log does not determine the quantity, only its prior), together (determined in
            combination with others, not alone).

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
        return errors_drawn([("before", self._result.before), ("after", self._result.after)])

    def _page(self) -> tuple[report.Section, str]:
        return sections.added_section(self._result), "twinmill.add"

    def _text(self) -> RenderableType:
        return show.added(self._result, NOT_WRITTEN)

    def __repr__(self) -> str:
        return (
            f"Addition({self.effect}: held out {self.heldout_before:.3g} -> "
            f"{self.heldout_after:.3g})"
        )


class Finding(Shown):
    """An effect that a model lacks, as a diagnosis found it.

    Attributes:
        effect: its name.
        parameters: estimates by name, with all other findings in the model.
        share: of the squared error above the noise floor that is the effect's.
        certainty: sure, group or doubtful.
        probability: that it is missing; of several robots that all lack it.
        score_heldout: None.

    Examples:
        >>> d.best.parameters["deceleration_mps2"] > 0
        True
    """

    def __init__(self, told: Mapping[str, Any], log: Log, again: bool):
        self._told, self._log, self._again = told, log, again
        self.effect, self.share = told["effect"], told["share"]
        self.certainty: Certainty = told["certainty"]
        self.probability: float | None = told.get("probability")
        self.score_heldout: float | None = told["score_heldout"]
        self.parameters = {key_of(p["name"]): p["value"] for p in told["parameters"]}

    def to_json(self) -> dict[str, Any]:
        """All results of the diagnosis for this effect.

        Returns:
            An entry of findings[] of `twinmill diagnose --json`, with the fields of ranking[].

        Examples:
            >>> d.best.to_json()["certainty"]
            'sure'
        """
        return plain(self._told)

    def add_to(self, model: Model | str | Path) -> Model:
        """Adds the effect to a model, fitted with all other parameters to the diagnosed log.

        Args:
            model: that lacks it, or the name of one.

        Returns:
            The new model.

        Raises:
            ValueError: the model has the effect already, and that of the diagnosis had not; or the
                effect is for another kind of command.

        Examples:
            >>> d.best.add_to(tm.Model.load("fitted.toml")).effects
            ['coasting']
        """
        model, effect = _model(model), catalogue_name(self.effect)
        if effect in model.effects and not self._again:
            raise ValueError(
                f"{model.name}: has {effect} already, and the model of the diagnosis had not; fit "
                "this one to the log."
            )
        return model.add(effect, self._log).model

    def table(self) -> pd.DataFrame:
        """Its parameters.

        Returns:
            name, value, std, unit; the std of a place or a time is None.

        Examples:
            >>> d.best.table()["name"].tolist()
            ['deceleration_mps2', ...]
        """
        return pd.DataFrame(self._told["parameters"])

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={value:.3g}" for name, value in self.parameters.items())
        return f"Finding({self.effect}: {values})"


class Diagnosis(Reported):
    """Posterior probabilities of the effects that a model may lack.

    Attributes:
        verdict: model_adequate, refit_enough, effect_missing, ambiguous, outside_catalogue or
            cannot_tell; of several robots that on what all of them lack.
        sentence: the same for people.
        found: effects that are missing, surest first.
        best: the first of them; None if none is named.
        nothing, outside: probabilities that nothing is missing, and that an unknown cause is.
        score: as of `compare`, of the model as given.
        score_refit: of its base at its posterior where no effect is new.
        score_after: with the likeliest set of new effects. All three are RMS errors of predictions
            0.1 to 2 s ahead over the noise floor; the models are the most probable ones, not those
            with the least score, so that it may also rise.

    Examples:
        >>> d = tm.diagnose("run.lcmlog", "fitted.toml")
        >>> d.nothing < 0.05
        True
    """

    _result: Inference | Fleet

    def __init__(self, result: Inference | Fleet, log: Log, file: ModelFile):
        self._result, self._file, self._log, answer = result, file, log, result.answer
        self.verdict: Verdict = result.verdict
        self.nothing, self.outside = answer.nothing, answer.outside
        self.sentence, self.score = judged.sentence(result), result.before.score
        self.score_refit, self.score_after = result.refitted.score, result.after.score
        told = result.to_json()
        ranked = {row["effect"]: row for row in told["ranking"]}
        there = {catalogue_name(name) for name in effect_names(file.model)}
        self.found = [
            Finding({**ranked[f["effect"]], **f}, log, catalogue_name(f["effect"]) in there)
            for f in told["findings"]
        ]
        self.best = self.found[0] if self.found else None

    @property
    def robots(self) -> "dict[int, Diagnosis]":
        """Each robot of several in the light of the others, by number; empty of one.

        Examples:
            >>> both = tm.diagnose("both.lcmlog", "fitted.toml")
            >>> {robot: one.best.effect for robot, one in both.robots.items()}
            {0: 'coasting', 1: 'coasting'}
        """
        if not isinstance(self._result, Fleet):
            return {}
        return {
            one.measurements[0].robot_id: Diagnosis(one, self._log, self._file)
            for one in self._result.robots
        }

    def to_json(self) -> dict[str, Any]:
        """All numbers and names, as of `twinmill diagnose --json`.

        Returns:
            As the page on probabilities tells; an absent number is None. Of several robots
            `robots_off` has those that differ from the others.

        Examples:
            >>> d.to_json()["found"]
            ['coasting']
        """
        told: dict[str, Any] = plain(judged.to_json(self._result))
        return told

    @_one_thread
    def next_run(
        self,
        *,
        duration_s: float = 30.0,
        floor_m: tuple[float, float] = (2.0, 2.0),
        max_duty: float = 1.0,
    ) -> "NextRun":
        """Designs the run that best discriminates between the effects in question.

        Args:
            duration_s: longest run.
            floor_m: free area, along and across the robot at its start, m.
            max_duty: highest duty of a wheel, 0.2 to 1; for velocity commands, share of the highest
                in the logs.

        Returns:
            See `next_run`; there is no second diagnosis.

        Raises:
            ValueError: no script can be within these limits, or none shows what is in question.

        Examples:
            >>> d.next_run(duration_s=20, floor_m=(2.5, 2.0)).duration_s <= 20
            True
        """
        limits = _limits(duration_s, floor_m, max_duty)
        check_limits([o.measurement for o in self._result.opened], self._file, limits)
        planned = NextRun(design(self._result, self._file, limits, lambda _: None))
        planned.input = self.input
        return planned

    def table(self) -> pd.DataFrame:
        """Effects and their numbers.

        Returns:
            effect, probability, certainty, name, value, std, unit (of both).

        Examples:
            >>> d.table()["effect"].unique().tolist()
            ['coasting']
        """
        columns = ["name", "value", "std", "unit"]
        rows = [
            (f.effect, f.probability, f.certainty, *(own[c] for c in columns))
            for f in self.found
            for own in f.to_json()["parameters"]
        ]
        return pd.DataFrame(rows, columns=["effect", "probability", "certainty", *columns])

    def plot(self) -> Figure:
        """Probability of each effect, of nothing and of an unknown cause.

        Returns:
            A figure of matplotlib.

        Examples:
            >>> len(d.plot().axes)
            1
        """
        return judged.bars(self._result).svg.picture

    def _page(self) -> tuple[report.Section, str]:
        return judged.section(judged.Told(self._result)), "twinmill.diagnose"

    def _text(self) -> RenderableType:
        return judged.terminal(judged.Told(self._result))

    def __repr__(self) -> str:
        return f"Diagnosis({self.verdict}: {self.sentence})"


class Explanation(Reported):
    """A model with what it lacked, and the diagnosis behind it.

    Attributes:
        model: the new one: the likeliest set of effects, all numbers at their posterior mean. It
            keeps what it misses in these logs, so that `diagnose` does not report that of others.
        diagnosis: of the model as given.
        after: comparison of the new model with the logs.
        score: of the new model on the logs that were judged.

    Examples:
        >>> explained = tm.explain("run.lcmlog", "fitted.toml")
        >>> explained.diagnosis.verdict
        'effect_missing'
    """

    def __init__(self, written: _better.Better, found: Diagnosis):
        self._written, self.diagnosis, self.model = written, found, Model(written.file)
        self.after = Comparison(written.after)
        self.score = self.after.score

    def to_json(self) -> dict[str, Any]:
        """All numbers and names, as of `twinmill explain --json`.

        Returns:
            Fields of the diagnosis, and those of the new model.

        Examples:
            >>> explained.to_json()["added"]
            ['coasting']
        """
        return {**self.diagnosis.to_json(), **plain(self._written.to_json())}

    def table(self) -> pd.DataFrame:
        """Quantities of the new model, as of `Model.table`.

        Returns:
            One row for each quantity.

        Examples:
            >>> "coasting.deceleration_mps2" in explained.table()["name"].tolist()
            True
        """
        return self.model.table()

    def steps(self) -> pd.DataFrame:
        """Scores of the model as given, of its refitted base, and with what was found.

        Returns:
            effect (`as given` first; `refit` is the base refitted, `equation` a formula) and
            score_heldout, which is None between effects that were found together.

        Examples:
            >>> explained.steps()["effect"].tolist()[:2]
            ['as given', 'refit']
        """
        return pd.DataFrame(
            {"effect": step["effect"] or "as given", "score_heldout": step["score_heldout"]}
            for step in self.diagnosis.to_json()["steps"]
        )

    def plot(self) -> Figure:
        """Errors over the horizon, of both models.

        Returns:
            A figure of matplotlib, as of `Comparison.plot`.

        Examples:
            >>> len(explained.plot().axes)
            3
        """
        both = [("as given", self._written.before), ("with what was found", self._written.after)]
        return errors_drawn(both)

    def _page(self) -> tuple[report.Section, str]:
        return judged.section(self._told), "twinmill.explain"

    def _text(self) -> RenderableType:
        return judged.terminal(self._told)

    @property
    def _told(self) -> judged.Told:
        return judged.Told(self.diagnosis._result, written=self._written)

    def __repr__(self) -> str:
        added = ", ".join(self._written.added) or "nothing"
        before = self._written.before.score
        return f"Explanation(added {added}: score {before:.3g} -> {self.score:.3g})"


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
    files = [path_of("log", path, several) for path in paths]
    tables = [path for path in files if is_steady_table(path)]
    return Log(
        [read_log(path) for path in files if path not in tables],
        [table for path in tables for table in read_steady_tables(path)],
    )


@_one_thread
def compare(log: Log | str | Path, model: Model | str | Path | None = None) -> Comparison:
    """Measures a model's prediction errors on a log, relative to the noise floor.

    Predictions start from measured poses; errors are taken 0.1, 0.2, 0.5, 1 and 2 s later.

    Args:
        log: a log, or the path of one.
        model: a model, or the name of one; None is TurboPi's.

    Returns:
        The score, with errors, noise floors and regimes of each robot.

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
def compare_runs(
    first: Log | str | Path,
    second: Log | str | Path,
    model: Model | str | Path | None = None,
    *,
    healthy: Iterable[Log | str | Path] = (),
    robot: int | None = None,
    alarm_rate: float = ALARM_RATE,
    progress: Callable[[str], None] | None = None,
) -> RunComparison:
    """Tells whether anything changed between two runs of one robot: what, how much, since when.

    What varies from day to day is told apart: how the marker is mounted, the battery's charge, the
    clocks' offset.

    Args:
        first: a healthy run, or the path of one.
        second: a later run of that robot.
        model: a model, or the name of one; None is TurboPi's.
        healthy: more healthy runs, on other days, which calibrate the alarm on this robot.
        robot: its number, where logs have several.
        alarm_rate: share of comparisons without a change that may be called changed.
        progress: called with a sentence on each step.

    Returns:
        What changed, with intervals, and what differs without being a change.

    Raises:
        LogError: a run cannot be judged, or has several robots; one sentence.
        ModelError: the model cannot be read.
        ValueError: the rate is not between 0 and 1.

    Examples:
        >>> runs = tm.compare_runs("run.lcmlog", "other.lcmlog", "fitted.toml")
        >>> runs.changed  # these are two robots of a kind
        True
    """
    model = _model(model)
    rate = float(checked("alarm_rate", alarm_rate, *NUMBER))
    if not 0 < rate < 1:
        raise ValueError(f"alarm_rate: is {rate:g}, and must be between 0 and 1.")
    one, two, *more = (_log(log) for log in (first, second, *healthy))

    def run(log: Log) -> Measurement:
        return of_robot(log.measurements(model), log.paths[0].name, robot)

    a = run(one)
    with right_before(one.paths[0].name):
        b = run(two)
    known = (a.log_sha256, b.log_sha256)
    others = [m for m in map(run, more) if m.log_sha256 not in known]
    found = _compare_runs(
        *(a, b, model.file), healthy=others, rate=rate, tell=progress or (lambda _: None)
    )
    return RunComparison(found)


@_one_thread
def fit(
    log: Logs,
    model: Model | str | Path | None = None,
    *,
    hold: Iterable[str] = (),
    free: Iterable[str] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    settings: FitSettings = FIT_SETTINGS,
) -> Fit:
    """Fits a model, and the parameters of its effects, to a log.

    By default these are free: gains, wheel speeds by duty and lag of the base, as far as the log
    determines them, and the parameters of all effects. Names are those of `Model.table`, or of an
    effect or a table as a whole: `coasting`, `base.wheel_speed_mps`.

    Args:
        log: a log, the path of one, or a list of these.
        model: start of the fit; a model, or the name of one; None is TurboPi's.
        hold: names of parameters that keep their values, free by default or not.
        free: names of the only free parameters, of base, robot or effects; None: the default.
        priors: mean and standard deviation of normal priors by name, of what is fitted, in place
            of the usual ones, which are wide and about the model's value.
        settings: convergence criteria.

    Returns:
        The new model, its parameters with uncertainties, and both comparisons.

    Raises:
        LogError: the log cannot be used; one sentence.
        ModelError: the model cannot be read, has no such quantity, one is free and held, or a
            prior cannot be or is of what is not fitted.

    Examples:
        >>> fitted = tm.fit("run.lcmlog", "turbopi.toml")
        >>> fitted.score <= fitted.before.score
        True
        >>> list(fitted.table().columns)
        ['name', 'value', 'std', 'unit', 'at_bound', 'seen', 'together', 'words', 'prior', 'held']
        >>> gains = ["base.forward_gain", "base.yaw_gain"]
        >>> tm.fit("run.lcmlog", "turbopi.toml", free=gains).stderr.dropna().index.tolist()
        ['base.yaw_gain', 'base.forward_gain']
    """
    start = _model(model)
    checked("settings", settings, FitSettings, "a `FitSettings`")
    choice = _fit.Choice(
        _names("hold", hold), None if free is None else _names("free", free), _priors(priors or {})
    )
    measurements = _log(log).measurements(start)
    path = Path(f"{start.file.path.stem}_fitted.toml")
    result = _fit.fit_model(
        measurements, start.file, path, "twinmill.fit", choice=choice, settings=settings
    )
    result = replace(result, child=_keeping.with_its_error(result.child, measurements))
    return _told(Fit(result), measurements)


def _names(what: str, names: Iterable[str]) -> tuple[str, ...]:
    checked(what, names, *NAMES)
    return tuple(checked(f"a name in {what}", name, str, "a text") for name in names)


def _priors(priors: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    checked("priors", priors, *BY_NAME)
    for name, prior in priors.items():
        two = isinstance(prior, (list, tuple)) and [isinstance(v, Real) for v in prior]
        if two != [True, True]:
            raise TypeError(
                f"prior of {name}: is {prior!r}, and must be (mean, standard deviation)."
            )
    return dict(priors)


@_one_thread
def compare_models(
    models: "Sequence[Model | str | Path] | Mapping[str, Model | str | Path]",
    log: Logs,
    *,
    refit: bool = True,
) -> pd.DataFrame:
    """Ranks models by six-fold cross-validation.

    Each model is fitted to all folds but one and predicts that one, in turn. Blocks of 8 s count as
    independent.

    Args:
        models: two at least, or a dictionary of them by name.
        log: a log, the path of one, or a list of these.
        refit: fit each model to the other folds of these very logs, also what a fit of yours held;
            False: all models predict as they are, as held-out logs of a finished model need it.

    Returns:
        One row per model, best first: rank, score_heldout (1.0 is as good as the log can tell),
        elpd (expected log predictive density, of all blocks; larger is better), elpd_diff (that of
        the best less this one's: 0 for the best, else positive), dse (standard error of the
        difference), weight (in the mixture that predicts best: stacking), p_chance (chance of so
        large a lead of the best, were no model better than this one). `attrs["correction"]` says
        how p_chance allows for the best being one of many.

    Raises:
        LogError: the log cannot be used; one sentence.
        ModelError: a model cannot be read.
        ValueError: there are not two models.

    Examples:
        >>> table = tm.compare_models(["turbopi.toml", "hidden.toml"], "run.lcmlog")
        >>> table.index[0], float(table["weight"].sum().round(6))
        ('hidden.toml', 1.0)
    """
    checked("refit", refit, *SWITCH)
    checked("models", models, (list, tuple, Mapping), "a list of models, or a dictionary of them")
    given = [_model(m) for m in (models.values() if isinstance(models, Mapping) else models)]
    if len(given) < 2:
        raise ValueError(f"models: {len(given)} cannot be compared; give two or more.")
    names = list(models) if isinstance(models, Mapping) else [model.name for model in given]
    if len(set(names)) < len(names):
        raise ValueError(f"models: two have one name ({', '.join(names)}); give a dictionary.")
    measurements = _log(log).measurements(given[0])
    found = _models.standings(_models.predicted(measurements, [m.file for m in given], refit))
    table = pd.DataFrame(
        [vars(standing) for standing in found], index=pd.Index(names, name="model")
    )
    table = table.sort_values("elpd", ascending=False, kind="stable")
    table.insert(0, "rank", range(1, len(table) + 1))
    table.attrs["correction"] = _models.CORRECTION
    return table


@_one_thread
def diagnose(
    log: Log | str | Path,
    model: Model | str | Path | None = None,
    *,
    own: Logs | None = None,
    without: Iterable[str] = (),
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Names the physical effect that a model lacks, or says that none is missing or identifiable.

    Args:
        log: a log, or the path of one; several of one robot that were loaded together are judged
            together.
        model: best one that was fitted to another log; None is TurboPi's.
        own: the log (or logs) of this robot that the model was fitted to: model errors there are
            not reported. Models of `fit` and `explain` keep these errors and do without.
        without: names of effects that are not considered.
        progress: called with a sentence on each step.

    Returns:
        The posterior probability of each effect; of several robots that all of them lack it, and
        `robots` has each.

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
    excluded = known("without", without, catalogue())
    measurements = log.measurements(model)
    before = _log(own).measurements(model) if own is not None else ()
    told = _diagnose.diagnose(
        measurements, model.file, before, _progress(progress), without=excluded
    )
    return _told(Diagnosis(told, log, model.file), measurements)


@_one_thread
def explain(
    log: Log | str | Path,
    model: Model | str | Path | None = None,
    *,
    own: Logs | None = None,
    formula: bool = True,
    progress: Callable[[str], None] | None = None,
) -> Explanation:
    """Diagnoses, adds the effects found, and estimates all parameters.

    Args:
        log: as of `diagnose`.
        model: best one that was fitted to another log; None is TurboPi's.
        own: as of `diagnose`.
        formula: also add a formula for what no effect explains, where one holds.
        progress: called with a sentence on each step.

    Returns:
        The new model, and the diagnosis behind it.

    Raises:
        LogError: the log cannot be used; one sentence.
        ModelError: the model cannot be read, or gives the robot numbers of its own.

    Examples:
        >>> explained = tm.explain("run.lcmlog", "fitted.toml")
        >>> explained.model.effects
        ['coasting']
    """
    log, model = _log(log), _model(model)
    checked("formula", formula, (bool,), "True or False")
    measurements = log.measurements(model)
    found = diagnose(log, model, own=own, progress=progress)
    path, result = Path(f"{model.file.path.stem}_explained.toml"), found._result
    if isinstance(result, Fleet):
        written = better_of_fleet(
            result, model.file, path, command="twinmill.explain", progress=_progress(progress)
        )
    else:
        told = result if formula else replace(result, formula=None)
        written = _better.better(told, model.file, path, "twinmill.explain")
    return _told(Explanation(written, found), measurements)


@_one_thread
def next_run(
    log: Log | str | Path,
    model: Model | str | Path | None = None,
    *,
    duration_s: float = 30.0,
    floor_m: tuple[float, float] = (2.0, 2.0),
    max_duty: float = 1.0,
    own: Logs | None = None,
    progress: Callable[[str], None] | None = None,
) -> NextRun:
    """Designs the run that best tells apart what these logs cannot.

    What is in question is what `diagnose` finds neither sure nor ruled out. Play the script, log
    it, and judge all logs together.

    Args:
        log: a log, or the path of one.
        model: that a diagnosis would be given; None is TurboPi's.
        duration_s: longest run.
        floor_m: free floor, m: how far along the way that the robot looks at its start, and how
            far across; it starts in the middle.
        max_duty: highest duty of a wheel as a share of full duty, 0.2 to 1 (not percent); of a
            robot told velocities, share of the highest in its logs.
        own: the log (or logs) that the model was fitted to; see `diagnose`.
        progress: called with a sentence on each step.

    Returns:
        The script, and what it would tell.

    Raises:
        LogError: the log cannot be used; one sentence.
        ModelError: the model cannot be read.
        ValueError: no script can be within these limits, or none shows what is in question.

    Examples:
        >>> run = tm.next_run("run.lcmlog", "fitted.toml", duration_s=20, floor_m=(2.5, 2))
        >>> list(run.table().columns)
        ['t_s', 'fl_pct', 'fr_pct', 'rl_pct', 'rr_pct']
    """
    log, model = _log(log), _model(model)
    limits = _limits(duration_s, floor_m, max_duty)
    measurements = log.measurements(model)
    before = _log(own).measurements(model) if own is not None else ()
    plan = plan_run(measurements, model.file, limits, _progress(progress), own=before)
    return _told(NextRun(plan), measurements)


def effects() -> list[Effect]:
    """The physical effects that a model can have: the catalogue.

    Returns:
        One card an effect, in the order of the catalogue.

    Examples:
        >>> "coasting" in [effect.name for effect in tm.effects()]
        True
    """
    return [Effect(entry) for entry in catalogue().values()]


def effect(name: str) -> Effect:
    """The card of one effect.

    Args:
        name: of an effect of the catalogue.

    Returns:
        What it is, its equation, its parameters, and where it comes from.

    Raises:
        ValueError: there is none; the sentence has the nearest.

    Examples:
        >>> tm.effect("coasting")
        Effect(coasting: ...)
    """
    return Effect(find_effect(checked("name", name, str, "the name of an effect")))


def simulate(
    model: Model | str | Path | None = None,
    n: int = 8,
    *,
    behavior: str = "milling_cmaes",
    duration_s: float = 60.0,
    plant: str = "planar",
    seed: int = 1,
    script: str | Path | NextRun | None = None,
    alike: bool = False,
) -> Log:
    """Simulates robots in the twin.

    As real robots of a kind, they differ from the model and from each other: gains of speed and of
    turning are drawn for each with the spread in the model's `[idiosyncrasy]`, 4 % of TurboPi's. So
    a log's own model may be stale by that much for its robots; with `alike=True` it is right for
    all of them.

    Args:
        model: a model, or the name of one; None is TurboPi's.
        n: number of robots.
        behavior: of all of them, or as `milling:5,self_centering:1`.
        duration_s: simulated time.
        plant: `planar`, or `mujoco` with contacts and rollers.
        seed: the same seed gives the same log.
        script: CSV of inputs or duties that all play instead of a behaviour, or a run that
            `next_run` designed.
        alike: all robots have the model's own gains, but for what it states of single ones.

    Returns:
        A log like a robot's own, in memory; `Log.save` writes it.

    Raises:
        ModelError: the model cannot be read.
        ValueError: the twin refuses a value; its own sentence.

    Examples:
        >>> swarm = tm.simulate(n=3, duration_s=20)
        >>> swarm.robots
        [0, 1, 2]
        >>> swarm.metrics().shape[0] > 0
        True
        >>> made = tm.simulate("turbopi.toml", n=1, duration_s=60, alike=True)
        >>> tm.compare(made, "turbopi.toml").score < 1.3
        True
    """
    checked("n", n, Integral, "a whole number")
    checked("behavior", behavior, str, "the name of a behaviour, or a mix of them")
    checked("duration_s", duration_s, Real, "a number of seconds")
    checked("plant", plant, str, "`planar` or `mujoco`")
    checked("seed", seed, Integral, "a whole number")
    checked("alike", alike, *SWITCH)
    if not isinstance(script, NextRun | None):
        script = path_of("script", script, "the path of a CSV file, or a designed run").resolve()
    model = _model(model)
    file = (model.set(dict.fromkeys(SPREADS, 0.0)) if alike else model).file
    options = ["--plant", plant, "--n", n, "--seed", seed, "--duration-s", duration_s]
    with TemporaryDirectory(prefix="twinmill.") as folder:
        place = Path(folder)
        (place / "model.toml").write_text(file.text)
        if isinstance(script, NextRun):
            script.save(place / "script.csv")
            script = place / "script.csv"
        options += ["--behavior", behavior] if script is None else ["--script", script]
        said = _run_twin(place, options)
        recorded = (place / "simulated.lcmlog").read_bytes()
        return Log([log_of(recorded, "simulated.lcmlog")], said=said)


def import_log(
    poses: str | Path | None = None,
    commands: str | Path | None = None,
    *,
    motive: str | Path | None = None,
    vicon: str | Path | None = None,
    io_tsv: Iterable[str | Path] = (),
    bag: str | Path | None = None,
    detections: str | Path | None = None,
    robot_id: int | None = None,
    heading_offset_deg: float | Mapping[int, float] = 0.0,
    **options: Any,
) -> Log:
    """Makes a log from motion capture and commands in files of other programs.

    It needs one source of poses (`poses`, `motive`, `vicon`), and one of commands (`commands`,
    `io_tsv`) unless the log is to have poses alone; or a bag, which has both. The page Files
    lists the columns of tables; those of pandas go into `Log.from_frames`. Arguments are named as
    the options of `twinmill import`, whose help says more.

    Args:
        poses: CSV: t_s, robot_id, x_m, y_m, theta_rad; one of ROS or of others with
            `rename`.
        commands: CSV: t_s, robot_id, and fl_pct, fr_pct, rl_pct, rr_pct, or vx_mps,
            vy_mps, omega_radps, or others; each row is held until the next.
        motive: CSV export of OptiTrack Motive.
        vicon: CSV export of Vicon Tracker or Nexus.
        io_tsv: io.tsv of robots.
        bag: ROS bag, with its topics in `pose` and `command`.
        detections: CSV of what cameras saw: t_s, robot_id, seen.
        robot_id: whose the rows are, for files that do not say.
        heading_offset_deg: from the tracked body's x axis to the robot's front, left positive; or
            by robot.
        options: `robot` (numbers by name) and `rename` (our column by the file's; by a robot's
            number a dictionary of its own), dictionaries; `mapping`, a path; `flip`, a list of our
            columns, or lists by robot; `exchange`, pairs of robots that have each other's poses;
            `up`;
            `pose_shift_s` and `pose_clock_ppm`, numbers, or dictionaries by robot;
            `heading_from_path`, `same_clock`; of a bag `pose` and `command` (lists of
            topics), `receive_stamps`, `wheelbase_m`, `full_duty`; of wheel speeds
            `wheel_factor`; `command_timeout_s`, after which a robot stops that hears nothing.

    Returns:
        A log, in memory; `Log.save` writes it.

    Raises:
        LogError: a file cannot be read, or its rows make no run; one sentence.
        ValueError: there is no such option; the sentence has the nearest.

    Examples:
        >>> from tempfile import mkdtemp
        >>> tables = Path(mkdtemp())
        >>> poses = tm.load("run.lcmlog").table().drop(columns="log")
        >>> commands = tm.load("run.lcmlog").commands().drop(columns=["log", "kind"])
        >>> poses.to_csv(tables / "poses.csv", index=False)
        >>> commands.to_csv(tables / "commands.csv", index=False)
        >>> tm.import_log(tables / "poses.csv", tables / "commands.csv")
        Log(imported.lcmlog: robot 0, 60 s)
    """
    checked("robot_id", robot_id, (Integral, NoneType), "the number of a robot")
    turn_deg = _of_robots("heading_offset_deg", heading_offset_deg, *OF_ROBOTS)
    offset_rad = (
        {robot: float(np.radians(deg)) for robot, deg in turn_deg.items()}
        if isinstance(turn_deg, Mapping)
        else float(np.radians(turn_deg))
    )
    how = ImportOptions(
        robot_id=robot_id, heading_offset_rad=offset_rad, **_import_options(options)
    )
    given = {"poses": poses, "commands": commands, "motive": motive, "vicon": vicon, "bag": bag}
    given["detections"] = detections
    wanted = f"{A_PATH}; data frames go into tm.Log.from_frames"
    files = {k: None if path is None else path_of(k, path, wanted) for k, path in given.items()}
    several = checked("io_tsv", io_tsv, (list, tuple), "a list of paths")
    with TemporaryDirectory(prefix="twinmill.") as folder:
        out = Path(folder) / "imported.lcmlog"
        told = _import.import_log(
            *(files["poses"], files["commands"], out),
            motive=files["motive"],
            vicon=files["vicon"],
            io_tsv=tuple(path_of("io_tsv", path, A_PATH) for path in several),
            bag=files["bag"],
            detections=files["detections"],
            options=how,
        )
        made = log_of(out.read_bytes(), out.name)
        said = [text for text in told["warnings"] if text not in made.warnings]
        return Log([made], said=said)


def _import_options(options: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of `ImportOptions`, once each is known to be of its kind."""
    told = {}
    for name in known("option", options, IMPORT_OPTIONS):
        field, kinds, wanted = IMPORT_OPTIONS[name]
        told[field] = _of_robots(name, options[name], kinds, wanted)
    if "mapping" in told:
        told["mapping"] = Path(told["mapping"])
    if "rename" in told:
        names = told["rename"]
        own = {robot: names[robot] for robot in names if isinstance(robot, Integral)}
        for robot, renames in own.items():
            checked(f"rename of {robot!r}", renames, *BY_NAME)
        told["rename"] = {old: new for old, new in names.items() if old not in own}
        told["own_renames"] = own
    if "exchange" in told:
        for pair in told["exchange"]:
            two = isinstance(pair, (list, tuple)) and [isinstance(n, Integral) for n in pair]
            if two != [True, True]:
                raise TypeError(f"exchange: has {pair!r}, and must be {PAIRS}.")
        told["exchange"] = tuple(map(tuple, told["exchange"]))
    if "flips" in told:
        flips = told["flips"]
        by_robot = flips if isinstance(flips, Mapping) else {None: flips}
        told["flips"] = {robot: frozenset(names) for robot, names in by_robot.items()}
    return told


def _of_robots(name: str, given: Any, kinds: Any, wanted: str) -> Any:
    """Checks an option's value, which is one for all robots or a dictionary by robot."""
    checked(name, given, kinds, wanted)
    if isinstance(given, Mapping) and kinds is not Mapping:
        of_one: tuple[Any, str] = NUMBER if Real in kinds else NAMES
        for robot, own in given.items():
            checked(f"{name} of {robot!r}", own, *of_one)
            checked(f"{robot!r} in {name}", robot, Integral, "the number of a robot")
    return given


def _format(to: str, forms: type[Form]) -> Form:
    """One of these formats, by its name."""
    if checked("to", to, str, "the name of a format") not in [*forms]:
        raise ValueError(f"to: there is no '{to}'; choose one of {', '.join(forms)}.")
    return forms(to)


def _limits(duration_s: float, floor_m: tuple[float, float], max_duty: float) -> Limits:
    """Checks the limits of a designed run."""
    checked("duration_s", duration_s, Real, "a number of seconds")
    checked("floor_m", floor_m, (list, tuple), "two sides in m, as (2, 1.5)")
    checked("max_duty", max_duty, Real, "a share of full duty")
    if len(floor_m) != 2 or not all(isinstance(side, Real) and side > 0 for side in floor_m):
        raise ValueError(f"floor_m: is {floor_m}, and must be two sides in m, as (2, 1.5).")
    if not LONGEST_RUN_S >= duration_s > 0:
        raise ValueError(f"duration_s: is {duration_s}, and must be within 0 to {LONGEST_RUN_S:g}.")
    if not 1 >= max_duty >= LEAST_TOP_DUTY:
        raise ValueError(f"max_duty: is {max_duty}, and must be within {LEAST_TOP_DUTY} to 1.")
    return Limits(float(duration_s), (float(floor_m[0]), float(floor_m[1])), float(max_duty))


def _run_twin(place: Path, options: list[Any]) -> list[str]:
    """Writes simulated.lcmlog in a folder, by the model.toml in it; what the twin warned of."""
    command = [
        find_program("twin_run"), "--model", "model.toml", "--log", "simulated.lcmlog", *options,
    ]  # fmt: skip
    done = subprocess.run(
        [str(word) for word in command], cwd=place, capture_output=True, text=True, check=False
    )
    if done.returncode:
        said = done.stderr.strip().removeprefix("twin_run: ") or "twin_run failed."
        for word in ("--plant", "--n", "--seed", "--duration-s", "--behavior", "--script"):
            said = said.replace(word, word[2:].replace("-", "_"))
        raise ValueError(said.replace(" (--help lists the options)", ""))
    return [line.removeprefix("twin_run: ") for line in done.stderr.splitlines()]


def _log(log: Logs) -> Log:
    """One object of all logs that are named."""
    if isinstance(log, (list, tuple)):
        return Log.joined([_log(one) for one in log])
    if isinstance(log, (str, Path)):
        return load(log)
    own: Log = checked("log", log, Log, f"a log, {A_PATH}, or a list of these")
    return own


def _model(model: Model | str | Path | None) -> Model:
    wanted = "a model, or the name of one"
    model = checked("model", model, (Model, str, Path, NoneType), wanted)
    if isinstance(model, Model):
        return model
    return Model.load(DEFAULT_MODEL if model is None else model)


def _progress(progress: Callable[[str], None] | None) -> Callable[[str], None]:
    """A function that logs what it is told, and tells it on."""
    checked("progress", progress, (Callable, NoneType), "a function that takes a text")

    def tell(text: str) -> None:
        LOGGER.info(text)
        if progress is not None:
            progress(text)

    return tell


def _told(shown: Told, measurements: Measurements) -> Told:
    """The result, with what was found wrong with its logs."""
    mild = [str(f) for f in measurements.findings if not f.fatal]
    shown.left_out = (*measurements.excluded, *mild)
    for said in shown.left_out:
        LOGGER.warning(said)
    shown.input = tuple(finding.to_json() for finding in measurements.findings)
    return shown


def _scale(model: native.Model) -> tuple[float, float]:
    """Range of sight and radius of the body, in m, which metrics of swarms are over."""
    return model.get("sensor.range_m"), model.get("robot.body_radius_m")


def _poses(robot: RobotLog) -> dict[str, Any]:
    names = ("x_m", "y_m", "theta_rad")
    columns = zip(names, robot.pose.T, strict=True)
    return {"t_s": robot.pose_t_s, **dict(columns), "valid": robot.valid}


def _commands(robot: RobotLog) -> dict[str, Any]:
    value = robot.command * (100 if robot.command_kind == "duty" else 1)  # fractions to percent
    columns = zip(VALUES.get(robot.command_kind, ()), value.T, strict=False)
    return {"t_s": robot.command_t_s, "kind": robot.command_kind, **dict(columns)}


def _check_arrays(robot_id: int, wheelbase_m: float | None, *, same_clock: bool, name: str) -> None:
    checked("robot_id", robot_id, Integral, "the number of a robot")
    checked("wheelbase_m", wheelbase_m, (Real, NoneType), "a number")
    checked("same_clock", same_clock, *SWITCH)
    checked("name", name, str, "the name of a log")
    if not 0 <= robot_id < MOST_ROBOTS:
        raise LogError(f"robot_id: is {robot_id}, and must be within 0 to {MOST_ROBOTS - 1}.")


def _rows(logs: list[RecordedLog], columns: Callable[[RobotLog], dict[str, Any]]) -> pd.DataFrame:
    """One table of all robots in all logs."""
    parts = [
        pd.DataFrame({"log": log.path.name, "robot_id": number, **columns(robot)})
        for log in logs
        for number, robot in log.robots.items()
    ]
    return pd.concat(parts, ignore_index=True)


def _steady_rows(told: SteadyTable) -> pd.DataFrame:
    table = pd.DataFrame(told.inputs, columns=list(told.input_names))
    table.insert(0, "log", told.log_name)
    table.insert(1, "robot_id", told.robot_id)
    return table.assign(runs=told.runs, **dict(zip(told.columns, told.value.T, strict=True)))
