# SPDX-License-Identifier: Apache-2.0
"""One drive in the files of every source of poses and commands that `twinmill import` reads."""

import dataclasses
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
from mcap.writer import Writer

START_S = 1_700_000_000  # of the bag's and the topics' clocks
STEP_S, HELD_S, DURATION_S = 0.05, 1.2, 36.0
LATE_NS = 5_000_000  # of receipt, against the headers


@dataclasses.dataclass(frozen=True)
class Drive:
    """Commands of a robot and its places, at equal times; world z up.

    Attributes:
        t_s: (N,); pose_t_s (N,), likewise.
        told: (N, 3) vx_mps, vy_mps, omega_radps.
        place_m: (N, 3).
        heading_rad: (N,) about z.
    """

    t_s: np.ndarray
    pose_t_s: np.ndarray
    told: np.ndarray
    place_m: np.ndarray
    heading_rad: np.ndarray

    @property
    def quaternion(self) -> np.ndarray:
        """(N, 4) w, x, y, z."""
        zero = np.zeros(len(self.t_s))
        half = self.heading_rad / 2
        return np.column_stack([np.cos(half), zero, zero, np.sin(half)])


def drive() -> Drive:
    """A robot on mecanum wheels that obeys at once; its path is summed here."""
    random = np.random.default_rng(5)
    t_s = np.arange(0, DURATION_S, STEP_S)
    choices = np.array(
        [[0.25, 0, 0], [-0.2, 0, 0], [0, 0, 1.0], [0, 0.2, 0], [0.2, 0, 0.7], [0.1, -0.15, -0.9]]
    )
    order = random.permutation(np.arange(int(DURATION_S / HELD_S) + 1) % len(choices))
    told = choices[order[(t_s / HELD_S).astype(int)]]
    heading = 0.4 + np.concatenate([[0], np.cumsum(told[:-1, 2])]) * STEP_S
    middle = heading + told[:, 2] * STEP_S / 2
    steps = (told[:, 0] + 1j * told[:, 1]) * np.exp(1j * middle) * STEP_S
    place = np.concatenate([[0], np.cumsum(steps[:-1])])
    place = np.column_stack([place.real, place.imag, np.full(len(t_s), 0.1)])
    place[:, :2] += random.normal(0, 3e-4, (len(t_s), 2))
    heading = np.angle(np.exp(1j * heading))
    return Drive(t_s, t_s, told, place, heading)


def _table(path: Path, header: str, rows: np.ndarray) -> str:
    np.savetxt(path, rows, "%.7f", ",", header=header, comments="")
    return str(path)


def _commands(folder: Path, run: Drive) -> list[str]:
    rows = np.column_stack([run.t_s, run.told])
    path = _table(folder / "c.csv", "t_s,vx_mps,vy_mps,omega_radps", rows)
    return ["--commands", path]


def tables(folder: Path, run: Drive) -> list[str]:
    """Poses with an angle, and commands."""
    rows = np.column_stack([run.pose_t_s, run.place_m, run.heading_rad])
    poses = _table(folder / "p.csv", "t_s,x_m,y_m,z_m,theta_rad", rows)
    return ["--poses", poses, *_commands(folder, run), "--robot-id", "1"]


def quaternions(folder: Path, run: Drive) -> list[str]:
    """Poses with a quaternion, and commands."""
    rows = np.column_stack([run.pose_t_s, run.place_m, run.quaternion])
    poses = _table(folder / "p.csv", "t_s,x_m,y_m,z_m,qw,qx,qy,qz", rows)
    return ["--poses", poses, *_commands(folder, run), "--robot-id", "1"]


def topics(folder: Path, run: Drive) -> list[str]:
    """One table of two topics, as programs for ROS merge them: cells of the other are empty."""
    header = ["__time"]
    header += [f"/odom/pose/pose/position/{axis}" for axis in "xyz"]
    header += [f"/odom/pose/pose/orientation/{axis}" for axis in "wxyz"]
    header += ["/cmd_vel/linear/x", "/cmd_vel/linear/y", "/cmd_vel/angular/z"]
    seen = np.column_stack([run.place_m, run.quaternion])
    rows = [
        (t, f"{START_S + t:.6f},{_cells(row)},,,")
        for t, row in zip(run.pose_t_s, seen, strict=True)
    ]
    rows += [
        (t, f"{START_S + t:.6f},,,,,,,,{_cells(row)}")
        for t, row in zip(run.t_s, run.told, strict=True)
    ]
    lines = [",".join(header), *(line for _, line in sorted(rows, key=lambda row: row[0]))]
    (folder / "all.csv").write_text("\n".join(lines) + "\n")
    path = str(folder / "all.csv")
    return ["--poses", path, "--commands", path, "--robot-id", "1"]


def _cells(row: np.ndarray) -> str:
    return ",".join(f"{value:.7f}" for value in row)


def motive(folder: Path, run: Drive) -> list[str]:
    """An export of Motive with y up: x, y, z of it are x, z, -y of the room."""
    head = (
        "Format Version,1.23,Rotation Type,Quaternion,Length Units,Meters,Coordinate Space,Global"
    )
    columns = ["Rotation"] * 4 + ["Position"] * 3
    rows = [
        head,
        "",
        ",Type" + ",Rigid Body" * 7,
        ",Name" + ",rover_1" * 7,
        ",ID" + ",1" * 7,
        ",," + ",".join(columns),
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z",
    ]
    w, x, y, z = run.quaternion.T
    px, py, pz = run.place_m.T
    values = np.column_stack([run.pose_t_s, x, z, -y, w, px, pz, -py])
    rows += [f"{k},{_cells(row)}" for k, row in enumerate(values)]
    (folder / "take.csv").write_text("\n".join(rows) + "\n")
    return ["--motive", str(folder / "take.csv"), *_commands(folder, run)]


def vicon(folder: Path, run: Drive) -> list[str]:
    """An export of Vicon with quaternions; its stamps are its frames."""
    rows = [
        "Objects",
        f"{1 / STEP_S:g}",
        ",,rover_1:rover_1",
        "Frame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ",
        ",,,,,,mm,mm,mm",
    ]
    w, *xyz = run.quaternion.T
    values = np.column_stack([*xyz, w, 1000 * run.place_m])
    frames = np.round(run.pose_t_s / STEP_S).astype(int) + 1
    rows += [f"{k},0,{_cells(row)}" for k, row in zip(frames, values, strict=True)]
    (folder / "v.csv").write_text("\n".join(rows) + "\n")
    return ["--vicon", str(folder / "v.csv"), *_commands(folder, run)]


def bag(folder: Path, run: Drive) -> list[str]:
    """A ROS 2 bag of PoseStamped and TwistStamped, packed by hand as CDR; receipt is late."""
    vector = "float64 x\nfloat64 y\nfloat64 z\n"
    time = "int32 sec\nuint32 nanosec\n"
    header = "builtin_interfaces/Time stamp\nstring frame_id\n"
    parts = {
        "std_msgs/Header": header,
        "builtin_interfaces/Time": time,
        "geometry_msgs/Pose": (
            "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
        ),
        "geometry_msgs/Point": vector,
        "geometry_msgs/Quaternion": vector + "float64 w\n",
        "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
        "geometry_msgs/Vector3": vector,
    }

    def schema(own: str, used: tuple[str, ...]) -> bytes:
        more = [f"{'=' * 80}\nMSG: {name}\n{parts[name]}" for name in used]
        return (f"std_msgs/Header header\n{own}\n" + "".join(more)).encode()

    stamp = ("std_msgs/Header", "builtin_interfaces/Time")
    pose = ("geometry_msgs/Pose", "geometry_msgs/Point", "geometry_msgs/Quaternion")
    twist = ("geometry_msgs/Twist", "geometry_msgs/Vector3")
    kinds = {
        "/r1/pose": ("PoseStamped", schema("geometry_msgs/Pose pose", stamp + pose)),
        "/r1/cmd_vel": ("TwistStamped", schema("geometry_msgs/Twist twist", stamp + twist)),
    }
    w, *xyz = run.quaternion.T
    seen = np.column_stack([run.place_m, *xyz, w])
    zero = np.zeros(len(run.t_s))
    told = np.column_stack([run.told[:, :2], zero, zero, zero, run.told[:, 2]])
    with (folder / "run.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="test")
        rows = []
        for (topic, (kind, text)), t_s, values in zip(
            kinds.items(), (run.pose_t_s, run.t_s), (seen, told), strict=True
        ):
            number = writer.register_schema(f"geometry_msgs/msg/{kind}", "ros2msg", text)
            channel = writer.register_channel(topic, "cdr", number)
            rows += [(t, channel, row) for t, row in zip(t_s, values, strict=True)]
        for t, channel, row in sorted(rows, key=lambda r: r[:2]):
            at_ns = START_S * 10**9 + round(t * 1e9)
            head = struct.pack("<IiII4s", 0x100, *divmod(at_ns, 10**9), 2, b"m\0\0\0")
            data = head + b"\0" * (-(len(head) - 4) % 8) + struct.pack(f"<{len(row)}d", *row)
            writer.add_message(channel, at_ns + LATE_NS, data, at_ns)
        writer.finish()
    return ["--bag", str(folder / "run.mcap"), "--pose", "/r1/pose", "--command", "/r1/cmd_vel"]


def io_tsv(folder: Path, run: Drive) -> list[str]:
    """Duties from a TurboPi's own file: moves of a speed, a direction and a turn, 90 ahead."""
    rows = np.column_stack([START_S + run.pose_t_s, run.place_m, run.heading_rad])
    poses = _table(folder / "p.csv", "t_s,x_m,y_m,z_m,theta_rad", rows)
    ahead, left, turn = run.told.T
    direction_deg = np.degrees(np.arctan2(ahead, -left))
    moves = np.column_stack([200 * np.hypot(ahead, left), direction_deg, -turn / 2])
    lines = ["time_ns\tdetected\tsmoothed_detected\tmoves"]
    lines += [
        f"{START_S * 10**9 + round(t * 1e9)}\t0\t0\t[({v:.5f}, {d:.5f}, {w:.5f})]"
        for t, (v, d, w) in zip(run.t_s, moves, strict=True)
    ]
    (folder / "io.tsv").write_text("\n".join(lines) + "\n")
    return ["--poses", poses, "--io-tsv", str(folder / "io.tsv"), "--robot-id", "1"]


SOURCES: dict[str, Callable[[Path, Drive], list[str]]] = {
    made.__name__: made for made in (tables, quaternions, topics, motive, vicon, bag)
}
OF_DUTIES = {"io_tsv": io_tsv}  # whose commands no model of the import explains
