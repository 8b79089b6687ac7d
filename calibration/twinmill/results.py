# SPDX-License-Identifier: Apache-2.0
"""Results without a model of their own: comparisons, designed runs, cards."""

from collections.abc import Iterable
from io import StringIO
from numbers import Real
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure
from rich.console import RenderableType

from twinmill import report
from twinmill.arguments import checked
from twinmill.experiment.design import Plan
from twinmill.experiment.played import csv_text
from twinmill.files import plain, replacing
from twinmill.fitting import compare as _compare
from twinmill.fitting.residuals import Residuals
from twinmill.predict.paths import predicted_path
from twinmill.report import (
    comparisons,
    error_figures,
    next_run_figures,
    runs,
    sections,
    show,
    steady,
    swarm_comparison,
)
from twinmill.report import next_run as next_run_report
from twinmill.runs import compare as _compare_runs
from twinmill.shown import A_PATH, Reported, Shown, path_of
from twinmill.swarm import compare as _compare_swarm

NOT_SAVED = next_run_report.How("Not written yet: `run.save(path)` of this result does that.", [])


class Comparison(Reported):
    """Prediction errors of a model on a log, relative to the noise floor.

    Attributes:
        score: RMS of prediction errors over the noise floor: 1.0 is as good as the log can tell;
            above 1.3 something is missing.
        verdict: interpretation of the score, in a sentence.

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
            log, robot_id, channel, unit, horizon_s, rms, floor (one standard deviation of what
            noise alone would cause; both in the unit), ratio.

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

    def residuals(self) -> pd.DataFrame:
        """Each prediction beside what was measured.

        Returns:
            log, robot_id, t_s (start of the prediction), horizon_s, channel, unit, measured and
            predicted (how far forward, left and round it goes, seen from the start), residual
            (measured less predicted, the short way round) and floor (the noise floor, one standard
            deviation), all in the unit. In a steady-state table t_s and horizon_s are NaN.

        Examples:
            >>> rows = found.residuals().query("channel == 'forward' and horizon_s == 0.5")
            >>> bool(np.allclose(rows["measured"] - rows["predicted"], rows["residual"]))
            True
        """
        return residuals_table(Residuals.of(robot) for robot in self._result.robots)

    def paths(self, restart_s: float = 2.0) -> pd.DataFrame:
        """Measured poses beside those that follow from the commands alone.

        Args:
            restart_s: how long a prediction goes on before the next begins at a measured pose;
                `math.inf` for one from the log's begin, and from each gap of the poses.

        Returns:
            log, robot_id, t_s (of the poses, on the capture's clock), since_s (t_s at which the
            prediction began), x_m, y_m, theta_rad as measured, and x_predicted_m, y_predicted_m,
            theta_predicted_rad. Lost poses and steady-state tables have none.

        Raises:
            ValueError: `restart_s` is not above zero.

        Examples:
            >>> paths = found.paths(restart_s=5)
            >>> ahead_s = paths["t_s"] - paths["since_s"]
            >>> bool(0 <= ahead_s.min() and ahead_s.max() < 5.1)
            True
        """
        if not checked("restart_s", restart_s, Real, "a number of seconds") > 0:
            raise ValueError(f"restart_s: {restart_s} s: give a time above zero, or math.inf.")
        logs = [r for r in self._result.robots if isinstance(r, _compare.RobotComparison)]
        return pd.concat([paths_table(r, restart_s) for r in logs], ignore_index=True)

    def plot(self) -> Figure:
        """Errors over the horizon, with the noise floor; for a steady-state table, its values.

        Of several robots the one with the highest score is shown.

        Returns:
            A figure of matplotlib: m for forward and left, degrees for heading, over s.

        Examples:
            >>> len(found.plot().axes)  # forward, left, heading
            3
        """
        return errors_drawn([("this model", self._result)])

    def _page(self) -> tuple[report.Section, str]:
        return sections.comparison_section(self._result), "twinmill.compare"

    def _text(self) -> RenderableType:
        return show.comparison(self._result)

    def __repr__(self) -> str:
        logs = ", ".join(dict.fromkeys(r.measurement.log_name for r in self._result.robots))
        return f"Comparison({self._result.model_name}, {logs}: score {self.score:.3g})"


class RunComparison(Reported):
    """Changes between two runs of one robot.

    Attributes:
        changed: whether anything did, beyond what varies from day to day.
        verdict: what, by how much, and since when; or that nothing did.
        p_value: rank among the healthy runs; without any, chance by the standard errors alone.
        remounted: whether the marker was mounted anew, which is no change of the robot.

    Examples:
        >>> tm.compare_runs("run.lcmlog", "other.lcmlog", "fitted.toml").verdict
        'Changed in other.lcmlog: the forward speed is ... % lower (...'
    """

    def __init__(self, result: _compare_runs.RunComparison):
        self._result = result
        self.changed, self.remounted = result.changed, result.remounted
        self.verdict = " ".join(runs.verdict(result))
        found = result.alarm
        self.p_value = found.p_errors if found.p_rank is None else found.p_rank

    def table(self) -> pd.DataFrame:
        """Each kind of change by itself, were it all that changed.

        Returns:
            name, value, std, low, high (95 %), unit, score (value over std), smallest_shown (by
            half of such pairs), shown_9_of_10.

        Examples:
            >>> "wheels.left" in set(runs.table()["name"])
            True
        """
        return pd.DataFrame(self._result.to_json()["numbers"])

    def plot(self) -> Figure:
        """All differences with their intervals, and from where on each is an alarm.

        Returns:
            A figure of matplotlib: shares in percent, and times in ms.

        Examples:
            >>> len(runs.plot().axes)
            2
        """
        return runs.intervals(self._result).svg.picture

    def _page(self) -> tuple[report.Section, str]:
        return runs.section(self._result), "twinmill.compare_runs"

    def _text(self) -> RenderableType:
        return runs.terminal(self._result)

    def __repr__(self) -> str:
        return f"RunComparison({self.verdict})"


class NextRun(Reported):
    """A script for the robot that discriminates between effects that the logs so far cannot.

    Attributes:
        why: the open question.
        separates: effects in question with a power above one half.
        predicted_power: mean power, each effect in question being equally probable.
        duration_s: of the script.

    Examples:
        >>> run = tm.next_run("run.lcmlog", "fitted.toml")
        >>> 0 <= run.predicted_power <= 1
        True
    """

    def __init__(self, plan: Plan):
        self._result = plan
        self.why, self.separates = plan.why, plan.separates
        self.predicted_power, self.duration_s = plan.predicted_power, plan.rows.end_s

    def table(self) -> pd.DataFrame:
        """The script; each row is held until the next, and the last one stops.

        Returns:
            t_s, and duties in percent (fl_pct, fr_pct, rl_pct, rr_pct) or velocities (vx_mps,
            vy_mps, omega_radps).

        Examples:
            >>> float(run.table()["t_s"].iloc[0])
            0.0
        """
        return pd.read_csv(StringIO(csv_text(self._result.rows)))

    def effects(self) -> pd.DataFrame:
        """Power of the run for each effect in question, surest first.

        Returns:
            effect, rival (the closest; None: the base), margin_before and margin (chi2 of the
            effect's signature that the rival cannot reproduce), power_before and power
            (probability that the effect is named if it is the missing one).

        Examples:
            >>> list(run.effects().columns)[:2]
            ['effect', 'rival']
        """
        return pd.DataFrame(self._result.to_json()["effects"])

    def plot(self) -> Figure:
        """The predicted path, with and without each effect in question.

        Returns:
            A figure of matplotlib, axes in m from the middle of the floor.

        Examples:
            >>> run.plot().axes[0].get_xlabel()
            'x (m)'
        """
        return next_run_figures.floor(self._result).svg.picture

    def save(self, path: str | Path, force: bool = False) -> None:
        """Writes the script as robots, `simulate` and `twin_run` read it.

        Args:
            path: new file (.csv).
            force: replace it if it is there.

        Raises:
            ValueError: it is there, or cannot be written.

        Examples:
            >>> from tempfile import mkdtemp
            >>> run.save(Path(mkdtemp()) / "next.csv")
        """
        with replacing(path_of("path", path, A_PATH), force) as temporary:
            temporary.write_text(csv_text(self._result.rows))

    def _page(self) -> tuple[report.Section, str]:
        return next_run_report.section(self._result, NOT_SAVED), "twinmill.next_run"

    def _text(self) -> RenderableType:
        return next_run_report.terminal(self._result, NOT_SAVED)

    def __repr__(self) -> str:
        told = ", ".join(self.separates) or "nothing for sure"
        return f"NextRun({self.duration_s:.0f} s, tells apart {told})"


class SwarmComparison(Reported):
    """Test of a recorded swarm against swarms of the twin.

    Attributes:
        differs: significant at 5 %.
        verdict: the result in a sentence.
        p_energy, p_band: p-values by the energy distance, and by the largest deviation.

    Examples:
        >>> swarm = tm.simulate(n=3, duration_s=20)
        >>> 0 < swarm.compare_swarm(n_seeds=39).p_energy <= 1
        True
    """

    def __init__(self, result: _compare_swarm.SwarmComparison):
        self._result = result
        self.differs, self.verdict = result.test.differs, result.verdict
        self.p_energy, self.p_band = result.test.p_value, result.test.p_band

    def table(self) -> pd.DataFrame:
        """Metrics over time, in means over 2 s.

        Returns:
            metric, t_s (since the swarm began to move), recorded, and low, middle, high of the
            twin's runs.

        Examples:
            >>> swarm = tm.simulate(n=3, duration_s=20)
            >>> list(swarm.compare_swarm(n_seeds=39).table().columns)
            ['metric', 't_s', 'recorded', 'low', 'middle', 'high']
        """
        told = self._result.to_json()
        parts = [
            pd.DataFrame({"metric": name, "t_s": told["t_s"], **series})
            for name, series in told["series"].items()
        ]
        return pd.concat(parts, ignore_index=True).rename(columns={"floor": "recorded"})

    def plot(self) -> Figure:
        """Metrics over time: the recorded run, the twin's runs and their band.

        Returns:
            A figure of matplotlib, one panel a metric, over s.

        Examples:
            >>> swarm = tm.simulate(n=3, duration_s=20)
            >>> len(swarm.compare_swarm(n_seeds=39).plot().axes)
            6
        """
        return swarm_comparison.bands(self._result).svg.picture

    def _page(self) -> tuple[report.Section, str]:
        return swarm_comparison.section(self._result), "twinmill.Log.compare_swarm"

    def _text(self) -> RenderableType:
        return self.verdict

    def __repr__(self) -> str:
        return f"SwarmComparison({self.verdict})"


class Effect(Shown):
    """A card of the catalogue: one physical effect that a model can have.

    Attributes:
        name, summary, equation: as in the catalogue.
        stage: where in the signal path it acts.

    Examples:
        >>> tm.effect("coasting").stage
        'wheel'
    """

    def __init__(self, entry: dict[str, Any]):
        self._entry = checked("entry", entry, dict, "a card; `effect` takes its name")
        self.name, self.summary = entry["name"], entry["summary"]
        self.equation, self.stage = entry["equation"], entry["stage"]

    def to_json(self) -> dict[str, Any]:
        """All of the card, as `twinmill twin effects NAME --json`.

        Returns:
            name, summary, equation, stage, reference, parameters and more.

        Examples:
            >>> tm.effect("coasting").to_json()["parameters"][0]["unit"]
            'm/s^2'
        """
        card: dict[str, Any] = plain(self._entry)
        return card

    def table(self) -> pd.DataFrame:
        """Its parameters.

        Returns:
            name, unit, default, neutral (nothing happens), min, max, doc and more.

        Examples:
            >>> tm.effect("coasting").table()["name"].tolist()
            ['deceleration_mps2', 'viscous_per_s']
        """
        return pd.DataFrame(self._entry["parameters"])

    def _text(self) -> RenderableType:
        return show.effect(self._entry)

    def __repr__(self) -> str:
        return f"Effect({self.name}: {self.summary})"


def residuals_table(residuals: Iterable[Residuals]) -> pd.DataFrame:
    """A row for each prediction of all robots."""
    return pd.concat([pd.DataFrame(own.columns()) for own in residuals], ignore_index=True)


def paths_table(robot: _compare.RobotComparison, restart_s: float) -> pd.DataFrame:
    """A row for each pose that was not lost, measured and predicted."""
    track = robot.measurement.track
    since, predicted = predicted_path(robot.modelled, restart_s)
    known = since >= 0
    columns = {"log": robot.measurement.log_name, "robot_id": robot.robot_id}
    columns |= {"t_s": track.pose_t_s[known], "since_s": track.pose_t_s[since[known]]}
    columns |= dict(zip(("x_m", "y_m", "theta_rad"), track.pose[known].T, strict=True))
    names = ("x_predicted_m", "y_predicted_m", "theta_predicted_rad")
    return pd.DataFrame(columns | dict(zip(names, predicted[known].T, strict=True)))


def errors_drawn(results: list[tuple[str, _compare.Comparison]]) -> Figure:
    """Errors over the horizon, or a table's values, of the robot with the highest score.

    Args:
        results: by the name that each has in the figure; of the last, the robot is taken.
    """
    last = results[-1][1]
    if last.shown in (tables := comparisons.steady_comparisons(last)):
        return steady.values(steady.kinds(tables)[0]).svg.picture
    robot = last.robots.index(last.shown)
    robots = [(label, result.robots[robot]) for label, result in results]
    same = [(label, own) for label, own in robots if isinstance(own, _compare.RobotComparison)]
    return error_figures.error_growth(same).svg.picture
