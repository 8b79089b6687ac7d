# SPDX-License-Identifier: Apache-2.0
"""Detections as CSV beside velocity commands: what was seen is compared with where robots were."""

import json

import lcm
import numpy as np
import pytest
import turbopi

from twinmill.data.camera_frames import frames_of
from twinmill.data.log import LogError, read_log
from twinmill_cli.main import run

HALF_CONE_RAD = 0.4
MODEL = f"""
name = "m"
[base]
drive = "twist"
wheels = "none"
control_period_s = 0.05
[sensor]
range_m = 1.0
cone_rad = {2 * HALF_CONE_RAD}
vote_frames = 10
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Robot 1 turns on the spot at 0.5 rad/s, robot 2 at 0.6 m straight ahead of its start rests.

    Robot 1 sees it while it is within its cone, by the angle turned. Its pictures come at 20 Hz.
    """
    monkeypatch.chdir(tmp_path)
    t_s = np.arange(0, 40, 0.04)
    heading = np.where(t_s < 1, 0, 0.5 * (t_s - 1))
    noise = np.random.default_rng(1).normal(0, 1e-4, (2, 3, len(t_s)))
    rows = ["t_s,robot_id,x_m,y_m,theta_rad"]
    for number, (x, theta) in enumerate(((0.0, heading), (0.6, 0 * heading)), 1):
        values = np.array([x + 0 * t_s, 0 * t_s, theta]) + noise[number - 1]
        rows += [
            f"{t:.3f},{number},{a:.6f},{b:.6f},{c:.6f}"
            for t, (a, b, c) in zip(t_s, values.T, strict=True)
        ]
    (tmp_path / "p.csv").write_text("\n".join(rows) + "\n")
    rows = ["t_s,robot_id,vx_mps,vy_mps,omega_radps"]
    for t in np.arange(0, 40, 0.05):
        rows += [f"{t:.3f},1,0,0,{0.5 if t >= 1 else 0}", f"{t:.3f},2,0,0,0"]
    (tmp_path / "c.csv").write_text("\n".join(rows) + "\n")
    rows = ["t_s,robot_id,seen,range_m,bearing_deg"]
    for t in np.arange(0.5, 39.5, 0.05):
        bearing = np.angle(np.exp(-1j * np.interp(t, t_s, heading)))
        seen = abs(bearing) < HALF_CONE_RAD
        place = f"0.6,{np.degrees(bearing):.4f}" if seen else ","
        rows.append(f"{t:.3f},1,{int(seen)},{place}")
    (tmp_path / "d.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "m.toml").write_text(MODEL)
    return tmp_path


def import_all():
    files = ["--poses", "p.csv", "--commands", "c.csv", "--detections", "d.csv"]
    run(["import", *files, "--same-clock", "-o", "o.lcmlog", "--force"])


def test_what_was_seen_comes_back_as_written(folder):
    import_all()
    frames = frames_of(read_log(folder / "o.lcmlog").robots[1])
    rows = np.genfromtxt(folder / "d.csv", delimiter=",", skip_header=1)
    np.testing.assert_allclose(frames.t_s, rows[:, 0], atol=1e-6)
    np.testing.assert_array_equal(frames.raw, rows[:, 2] > 0)
    assert not frames.has_vote and frames_of(read_log(folder / "o.lcmlog").robots[2]) is None
    events = lcm.EventLog(str(folder / "o.lcmlog"))
    told = [turbopi.detection_t.decode(e.data) for e in events if e.channel == "R01_DETECTION"]
    for message, row in zip(told, rows, strict=True):
        assert (message.seen, message.robot_id) == (row[2], 1)
        np.testing.assert_allclose(message.range_m, row[3])
        np.testing.assert_allclose(message.bearing_rad, np.radians(row[4]), atol=1e-6)


def test_a_camera_as_the_model_says_agrees_and_another_does_not(folder, capsys):
    """A few of 780 pictures at the cone's edges may differ: 13 crossings, one picture each."""
    import_all()
    capsys.readouterr()
    run(["compare", "o.lcmlog", "--model", "m.toml", "--json"])
    bits = json.loads(capsys.readouterr().out)["bits"]
    assert bits["agreement"] > 1 - 13 / 780
    assert bits["vote_agreement"] is None
    (folder / "wide.toml").write_text(MODEL.replace("cone_rad = 0.8", "cone_rad = 1.6"))
    run(["compare", "o.lcmlog", "--model", "wide.toml", "--json"])
    wide = json.loads(capsys.readouterr().out)["bits"]
    # The wider cone sees 0.8 rad of each turn more: an eighth of all.
    assert 1 - wide["agreement"] == pytest.approx(0.8 / (2 * np.pi), abs=0.03)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("0.500,1,1", "0.500,1,2", "seen"),
        ("0.500,1,1,0.6", "0.500,1,1,-0.6", "range_m"),
        ("robot_id,seen", "robot_id,saw", "seen"),
        ("0.500,1,1", "0.500,7,1", "robot 7: has no poses"),
    ],
)
def test_a_wrong_table_is_one_sentence_and_no_log(old, new, why, folder, twinmill):
    text = (folder / "d.csv").read_text()
    assert old in text
    (folder / "d.csv").write_text(text.replace(old, new, 1))
    words = "import --poses p.csv --commands c.csv --detections d.csv -o x"
    code, _, error = twinmill(*words.split())
    assert code == 1 and why in error and error.count("\n") == 1
    assert not (folder / "x").exists()


def test_detections_of_another_time_are_refused(folder):
    from twinmill.data.importers.import_log import import_log

    text = "t_s,robot_id,seen\n" + "".join(f"{1000 + k},1,1\n" for k in range(5))
    (folder / "d.csv").write_text(text)
    with pytest.raises(LogError, match=r"do not overlap its poses; stamp them"):
        import_log(folder / "p.csv", folder / "c.csv", folder / "x", detections=folder / "d.csv")
