# SPDX-License-Identifier: Apache-2.0
"""Writes poses.csv and commands.csv of a robot that coasts, as motion capture and a script would.

The robot is a TurboPi of the twin that rolls on when its duties are zero, which the installed model
does not know. Put your own two files in their place.
"""

from pathlib import Path

import twinmill as tm
from twinmill.experiment.rich_script import write_rich_script

COASTING = '\n[[effect]]\nname = "coasting"\ndeceleration_mps2 = 0.7\nviscous_per_s = 0.5\n'


def main() -> None:
    """Writes both files into the working directory."""
    text = tm.Model.load("turbopi.toml").file.text + COASTING
    Path("real_robot.toml").write_text(text)
    write_rich_script("script.csv", 60, 1)
    log = tm.simulate("real_robot.toml", n=1, script="script.csv", duration_s=60)
    poses = log.table().query("valid")[["t_s", "robot_id", "x_m", "y_m", "theta_rad"]]
    poses.to_csv("poses.csv", index=False, float_format="%.6f")
    commands = log.commands()[["t_s", "robot_id", "fl_pct", "fr_pct", "rl_pct", "rr_pct"]]
    commands.to_csv("commands.csv", index=False, float_format="%.6f")
    for path in ("real_robot.toml", "script.csv"):
        Path(path).unlink()


if __name__ == "__main__":
    main()
