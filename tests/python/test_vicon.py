# SPDX-License-Identifier: Apache-2.0
"""Vicon's CSV exports, laid out as Tracker 3 writes them for ground robots."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from twinmill.data.importers.vicon import read_vicon
from twinmill.data.log import LogError, heading_rad

FRAMES, RATE_HZ = 400, 100
TURN_RADPS = 1.5  # nearly once round
MOUNT = Rotation.from_euler("xyz", (10, -15, 20), degrees=True)  # the object's axes on the robot


def turning():
    """Orientations of a level robot that turns, and of the object that is crooked on it."""
    level = Rotation.from_euler("z", TURN_RADPS * np.arange(FRAMES)[:, None] / RATE_HZ)
    return level, level * MOUNT


def helical(turned):
    """Vectors that go on beyond half a turn, as Tracker's do."""
    vector = turned.as_rotvec()
    angle = np.linalg.norm(vector, axis=1, keepdims=True)
    jumped = np.arange(FRAMES) > np.argmax(np.diff(vector[:, 2]) < -1)
    return np.where(jumped[:, None], vector * (1 - 2 * np.pi / angle), vector)


def export(path, angles, *, unit="rad", head="RX,RY,RZ", delimiter=",", bom="", tail=""):
    """A file of one object that drives along x at 200 mm/s."""
    rows = [
        f"{k + 1},0,{','.join(f'{a:.6f}' for a in angle)},{2 * k + 1},-30.5,167.1"
        for k, angle in enumerate(angles)
    ]
    rows[7] = "8,0" + "," * (len(angles[0]) + 3)  # lost
    rows[9] = "10,0" + ",0" * (len(angles[0]) + 3)  # lost, as other versions have it
    units = ",".join([unit] * len(angles[0]))
    names = ",,Global Angle car:car" + "," * (len(angles[0]) + 3)
    text = "\n".join(
        ["Objects", str(RATE_HZ), names, f"Frame,Sub Frame,{head},TX,TY,TZ",
         f",,{units},mm,mm,mm", *rows, tail]
    )  # fmt: skip
    if delimiter == ";":
        text = text.replace(",", ";").replace(".", ",")
    path.write_text(bom + text + "\n")
    return path


@pytest.mark.parametrize("kind", ["helical", "euler", "quaternion"])
def test_heading_is_the_crooked_objects_by_the_reading_that_keeps_the_robot_level(kind, tmp_path):
    _, crooked = turning()
    angles, head = {
        "helical": (helical(crooked), "RX,RY,RZ"),
        "euler": (crooked.as_euler("XYZ"), "RX,RY,RZ"),
        "quaternion": (crooked.as_quat(), "RX,RY,RZ,RW"),
    }[kind]
    (car,) = read_vicon(export(tmp_path / "v.csv", angles, head=head), {"car": 3}, "z")
    assert np.flatnonzero(~car.valid).tolist() == [7, 9]
    assert car.utime_us[[0, 100]].tolist() == [0, 1_000_000]
    np.testing.assert_allclose(car.position_m[100], [0.201, -0.0305, 0.1671])
    want = heading_rad(crooked.as_quat(scalar_first=True))
    apart = np.angle(np.exp(1j * (heading_rad(car.orientation_wxyz) - want)))[car.valid]
    assert np.abs(apart).max() < 1e-5
    taken = {"helical": "a helical vector", "euler": "Euler's"}.get(kind)
    assert [f"were taken for {taken}" in w for w in car.warnings] == [True] * (taken is not None)


def test_semicolons_commas_degrees_and_parts_that_follow_are_read(tmp_path):
    level, _ = turning()
    path = export(tmp_path / "v.csv", np.degrees(level.as_rotvec()), unit="deg", delimiter=";",
                  bom="\ufeff", tail="\nTrajectories\n100\n,,car:a\n")  # fmt: skip
    (car,) = read_vicon(path, {"car": 3}, "z")
    assert len(car.valid) == FRAMES and car.warnings == []  # level: both readings are the same
    turned = np.unwrap(heading_rad(car.orientation_wxyz)[car.valid])
    assert turned[-1] - turned[0] == pytest.approx(TURN_RADPS * (FRAMES - 1) / RATE_HZ, abs=1e-5)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("Objects", "Trajectories", "no part 'Objects' or 'Segments'"),
        ("\n100\n", "\nfast\n", "frames a second"),
        ("mm,mm,mm", "in,in,in", "has the unit 'in', not one of mm, cm, m"),
        ("rad,rad,rad", "grad,grad,grad", "has the unit 'grad', not one of deg, rad"),
        ("\n21,0", "\n20,0", "frame 20 comes after frame 20"),
        ("41,-30.5", "41,far", "row 26: 'far' is no number"),
        ("RX,RY,RZ,", "A,B,C,", "no body has RX"),
        ("car:car", "cab:cab", "rigid body 'cab' gives no robot_id"),
    ],
)
def test_what_is_wrong_is_one_sentence(old, new, words, tmp_path):
    path = export(tmp_path / "v.csv", turning()[0].as_rotvec())
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(LogError, match=words):
        read_vicon(path, {"car": 3}, "z")
