# SPDX-License-Identifier: Apache-2.0
"""A script for robots that listen to geometry_msgs/Twist: as a ROS bag or a publisher.

Duties become the body velocities that the model reaches at them. Robots stop when no command comes
for a while, so each is said again every PERIOD_S.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from string import Template

import numpy as np
import twinmill_native as native

from twinmill.arguments import option
from twinmill.experiment.played import Rows
from twinmill.extras import needing
from twinmill.files import check_new_file, replacing_folder
from twinmill.model.model_file import write_whole

TOPIC = "/cmd_vel"
PERIOD_S = 0.05
TWIST = "geometry_msgs/msg/Twist"
BAG_VERSION = 9  # of rosbag2's metadata: Jazzy and later
BAG_FILES = ("metadata.yaml", "*.db3", "*.mcap")  # of a bag that was written here


@dataclass(frozen=True)
class TwistScript:
    """Body velocities over time.

    Attributes:
        t_s: (K,) when each begins, ascending.
        twist: (K, 3) vx_mps, vy_mps, omega_radps.
        end_s: when the robot stops.
    """

    t_s: np.ndarray
    twist: np.ndarray
    end_s: float

    @classmethod
    def of(cls, model: native.Model, rows: Rows) -> "TwistScript":
        """Velocities as they are; duties as the model drives them.

        Raises:
            ValueError: the model's robot is not told duties, and the script holds some.
        """
        if rows.kind == "twist":
            return cls(rows.t_s, rows.command[:, :3], rows.end_s)
        if model.drive != "duty":
            raise ValueError(
                f"{option('script_as')}: the script holds duties, and the model's robot is told by "
                f"'{model.drive}'; give the model of a duty robot with {option('model')}."
            )
        duty = np.ascontiguousarray(rows.command)
        steady = native.steady(model, duty, [], np.zeros((0, 0)))[0]
        return cls(rows.t_s, np.round(steady[:, :3], 6) + 0.0, rows.end_s)

    def repeated(self) -> tuple[np.ndarray, np.ndarray]:
        """(M,) times every PERIOD_S and at every change, (M, 3) velocities; the last is zero."""
        ticks = np.arange(self.t_s[0], self.end_s, PERIOD_S)
        t_s = np.unique(np.round(np.concatenate([ticks, self.t_s[self.t_s < self.end_s]]), 6))
        row = np.searchsorted(self.t_s, t_s + 1e-9, "right") - 1
        return np.append(t_s, self.end_s), np.vstack([self.twist[row], np.zeros(3)])


def write_bag(script: TwistScript, out: Path, force: bool) -> None:
    """A rosbag2 folder (sqlite3) with the topic /cmd_vel; there whole or not at all.

    Raises:
        ValueError: it exists, or cannot be written.
    """
    with needing("ros"):  # slow to import
        from rosbags.rosbag2 import Writer
        from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    vector, twist = store.types["geometry_msgs/msg/Vector3"], store.types[TWIST]
    folder = replacing_folder(out, force, holds=BAG_FILES)
    with folder as bag, Writer(bag, version=BAG_VERSION) as writer:
        topic = writer.add_connection(TOPIC, TWIST, typestore=store)
        for t_s, (vx, vy, omega) in zip(*script.repeated(), strict=True):
            message = twist(vector(x=vx, y=vy, z=0.0), vector(x=0.0, y=0.0, z=omega))
            raw = store.serialize_cdr(message, TWIST)
            writer.write(topic, round(t_s * 1e9), raw)


def write_publisher(
    script: TwistScript,
    out: Path,
    force: bool,
    *,
    command: str,
    inputs: Iterable[Path] = (),
) -> None:
    """A Python program that needs ROS 2 alone; `inputs` as of `check_new_file`.

    Raises:
        ValueError: it exists, or cannot be written.
    """
    check_new_file(out, force, inputs)
    rows = [
        f"    ({t_s:.6g}, {vx:.6g}, {vy:.6g}, {omega:.6g}),"
        for t_s, (vx, vy, omega) in zip(script.t_s, script.twist, strict=True)
    ]
    template = Template((Path(__file__).parent / "publisher.py.in").read_text())
    said = command.replace("\\", "/").replace('"', "'")
    text = template.substitute(
        command=said, rows="\n".join(rows), end_s=f"{script.end_s:.6g}", period_s=f"{PERIOD_S:g}"
    )
    write_whole(out, text, force)
