# SPDX-License-Identifier: Apache-2.0
"""Runs of one robot on several days: whole, with a weak wheel, and weak from a moment on."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from twinmill.experiment.drives import drive
from twinmill_lab.challenge.physics import STEP_S, Hidden, catalogue_forms
from twinmill_lab.challenge.robots import draw_robot
from twinmill_lab.challenge.run import Plan, play, write_log

DAYS = {"first": 10, "whole": 11, "weak": 12, "later": 13, "always": 14}  # seed of each
DRIVEN_S, MOMENT_S = 40.0, 20.0
WEAKER, MUCH_WEAKER = 0.06, 0.15
# A quiet robot, so that forty seconds tell a percent.
ROBOT = replace(
    draw_robot(0, np.random.default_rng(1)),
    pose_hz=30.0,
    control_hz=25.0,
    drive_mps=0.002,
    drive_radps=0.01,
    drive_s=0.1,
    same_clock=True,
    offset_s=0.0,
)


def _weak_from(rim, v, _):
    late = np.arange(len(rim)) * STEP_S >= v["from_s"]
    return rim * (1 - v["loss"] * np.outer(late, np.arange(rim.shape[1]) == 0))


def mounting(name: str) -> tuple[float, float, float]:
    """Where the marker sits in that run: m ahead, m to the left, rad turned to the left."""
    random = np.random.default_rng(DAYS[name])
    catalogue_forms(ROBOT, random)  # drawn before it
    return tuple(float(v) for v in random.normal(0, [0.01, 0.01, 0.03]))


def make_days(folder: Path) -> dict[str, Path]:
    """Logs by what the robot was like, each with its own mounting of the marker, and its charge."""
    (folder / "model.toml").write_text(ROBOT.sheet(np.random.default_rng(2)))
    weak = {"first": (), "whole": (), "weak": (0.0, WEAKER), "later": (MOMENT_S, MUCH_WEAKER)}
    weak["always"] = weak["weak"]
    for name, loss in weak.items():
        seed = DAYS[name]
        random = np.random.default_rng(seed)
        forms = {h.name: h for h in catalogue_forms(ROBOT, random) if h.kind == "plain"}
        x_m, y_m, turned_rad = (float(v) for v in random.normal(0, [0.01, 0.01, 0.03]))
        hidden = [
            replace(forms["marker_offset"], values={"x_m": x_m, "y_m": y_m}),
            replace(forms["heading_bias"], values={"bias_rad": turned_rad}),
            replace(forms["battery_sag"], values={"strength": 0.8}),
        ]
        if loss:
            values = dict(zip(("from_s", "loss"), loss, strict=True))
            hidden.append(Hidden("weak", "plain", "rolls", _weak_from, values))
        legs = drive("mixed", DRIVEN_S, True, random)
        plan = Plan(ROBOT, legs, seed, full_V=float(random.uniform(7.7, 8.4)))
        write_log(plan, play(plan, hidden), folder / f"{name}.lcmlog")
    return {name: folder / f"{name}.lcmlog" for name in weak}
