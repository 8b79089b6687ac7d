# SPDX-License-Identifier: Apache-2.0
"""The commands that design the same next run as the workbench, play it, and judge it."""

import shlex
from collections.abc import Mapping
from pathlib import Path


def next_command(logs: list[Path], model: str, options: Mapping) -> list[str]:
    """Words of the command that designs the same run."""
    floor = f"{options['along_m']:g}x{options['across_m']:g}"
    duty = f"{options['duty_pct']:g}"
    limits = ["--duration-s", f"{options['duration_s']:g}", "--floor-m", floor]
    limits += ["--max-duty-pct", duty]
    return ["twinmill", "next", *map(str, logs), "--model", model, *limits, "-o", "script.csv"]


def then_commands(logs: list[Path], model: str, plan: Mapping) -> list[str]:
    """To play the script on the robot, and to diagnose with what comes of it."""
    robot = [
        "twinmill",
        "robot",
        "characterise",
        "--robot",
        str(plan["robot_id"]),
        "--script",
        "script.csv",
    ]
    if plan["drive"] == "twist":
        robot += ["--script-as", "publisher", "--out", "script.py"]
    else:
        robot += ["--cap-pct", str(plan["cap_pct"]), "--out", "next.lcmlog"]
    again = ["twinmill", "diagnose", *map(str, logs), "next.lcmlog", "--model", model]
    return [shlex.join(robot), shlex.join(again)]
