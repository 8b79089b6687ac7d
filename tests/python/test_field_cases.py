# SPDX-License-Identifier: Apache-2.0
"""Reports of people about their own logs are answered rightly, at the door.

The logs are simulated without Twinmill; each expected value is that of the simulation, or follows
from the table by a regression, as the README in each folder says.
"""

import re
from pathlib import Path

import numpy as np
import pytest
import twinmill_native as native

import twinmill as tm
from twinmill.data.checks import check_tracks
from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.log import LogError
from twinmill.data.measurement import load_measurements
from twinmill.diagnosis.diagnose import diagnose
from twinmill.fitting.add import add
from twinmill.fitting.compare import compare
from twinmill.fitting.fit import fit
from twinmill.model.model_file import ModelFile

XY = ("x_m", "y_m")


@pytest.fixture(scope="session")
def cases(data_dir) -> Path:
    folder = data_dir / "field_cases"
    if not folder.is_dir():
        pytest.skip(f"no field cases at {folder}")
    return folder


@pytest.fixture
def judged(cases, tmp_path):
    """Verdict on two tables of a folder, with a model of the robot; raises a refusal."""

    def make(folder, poses="poses", commands="commands", model="twist", **options):
        own = cases / folder
        tables = own / f"{poses}.csv", own / f"{commands}.csv"
        given = ImportOptions(**{"same_clock": True, **options})
        import_log(*tables, tmp_path / "x.lcmlog", options=given)
        file = ModelFile.load(str(cases / "models" / f"{model}.toml"))
        return load_measurements([tmp_path / "x.lcmlog"], file.model), file

    return make


def _said(measurements):
    return " ".join(map(str, measurements.findings))


@pytest.mark.parametrize("commands", ["commands", "wheels"])
@pytest.mark.parametrize("lever_m", [0.3, 0.5, 1.8])
def test_a_point_tracked_far_off_the_axle_is_told_with_its_lever(judged, lever_m, commands):
    model = "twist" if commands == "commands" else "diff_wheels"
    found, file = judged("lever_as_swap", f"poses_{lever_m}m", commands, model)
    (said,) = found.findings
    assert not said.fatal
    x_m, y_m = (float(said.remedy.split(f"{k} = ")[1].split(",")[0].split(")")[0]) for k in XY)
    assert (x_m, y_m) == pytest.approx((lever_m, 0), abs=0.02 * lever_m)
    text = file.text + f'[[effect]]\nname = "marker_offset"\nx_m = {x_m}\ny_m = {y_m}\n'
    advised = ModelFile(file.path, text, native.Model.from_toml(text, "advised"))
    assert compare(found, advised).score < compare(found, file).score / 5
    assert not check_tracks(found.tracks, advised.model)


def _of_another_point(cases, folder, lever_m, front_deg=0.0):
    """Poses of the point 0.3 m ahead, moved on the same body, its front turned to the left."""
    table = np.loadtxt(cases / "lever_as_swap/poses_0.3m.csv", delimiter=",", skiprows=1)
    moved_m = (complex(*lever_m) - 0.3) * np.exp(1j * table[:, 4])
    table[:, 2:4] += np.column_stack([moved_m.real, moved_m.imag])
    table[:, 4] -= np.radians(front_deg)
    header = "t_s,robot_id,x_m,y_m,theta_rad"
    np.savetxt(folder / "p.csv", table, delimiter=",", header=header, comments="", fmt="%.5f")
    return folder / "p"


@pytest.mark.parametrize(
    ("lever_m", "commands"),
    [((0.6, 0.0), "commands"), ((0.0, 1.0), "wheels"), ((1.8, -0.4), "commands")],
)
def test_a_lever_of_any_length_is_named_and_found_to_the_millimetre(
    judged, cases, tmp_path, lever_m, commands
):
    poses = _of_another_point(cases, tmp_path, lever_m)
    model = "twist" if commands == "commands" else "diff_wheels"
    runs, file = judged("lever_as_swap", poses, commands, model)
    found = diagnose(runs, file).findings[0]
    assert (found.effect, found.certainty) == ("marker_offset", "sure")
    assert [p.value for p in found.parameters] == pytest.approx(lever_m, abs=1e-3)
    out = tmp_path / "better.toml"
    added = add("marker_offset", runs, file, out=out, command="add")
    again = fit(runs, ModelFile.load(str(out)), out=tmp_path / "again.toml", command="fit")
    for told in (added.added, [p for p in again.parameters if "marker" in p.name]):
        assert [p.value for p in told] == pytest.approx(lever_m, abs=1e-3)


@pytest.mark.parametrize("drive", "abc")
def test_a_smooth_drive_with_slip_does_not_belie_one_clock(judged, drive):
    found, _ = judged("smooth_one_clock", f"poses_{drive}", f"commands_{drive}")
    assert not found.findings and found[0].same_clock


@pytest.mark.parametrize("drive", "ab")
def test_a_heading_that_is_turned_is_told_of_a_short_drive(judged, drive):
    tables = f"poses_{drive}", f"commands_{drive}", "diff_wheels"
    with pytest.raises(LogError, match="heading_offset_deg=90"):
        judged("turned_short", *tables, same_clock=False)


def test_a_heading_that_is_turned_and_a_shift_are_told_together(judged):
    tables = "poses_a", "commands_a", "diff_wheels"
    with pytest.raises(LogError, match="heading_offset_deg=90") as told:
        judged("turned_short", *tables, same_clock=False, pose_shift_s=4.0)
    shift_s = float(re.search(r"pose_shift_s=(-?[\d.]+\d)", str(told.value))[1])
    assert shift_s == pytest.approx(-4.0, abs=0.1)  # a lag of the search is in it


@pytest.mark.parametrize(
    ("lever_m", "front_deg", "shift_s"),
    [
        ((-0.2, 0.0), 90, 0.0),
        ((0.5, 0.1), -90, 3.0),
        ((1.0, 0.0), 180, 0.0),
        ((0.4, 0.0), 30, -2.0),
    ],
)
def test_a_turned_heading_of_a_point_off_the_axle_is_told_with_any_shift(
    judged, cases, tmp_path, lever_m, front_deg, shift_s
):
    poses = _of_another_point(cases, tmp_path, lever_m, front_deg)
    given = dict(same_clock=False, pose_shift_s=shift_s)
    with pytest.raises(LogError) as told:
        judged("lever_as_swap", poses, "wheels", "diff_wheels", **given)
    said = str(told.value)
    off_deg = float(re.search(r"heading_offset_deg=(-?\d+)", said)[1])
    assert (off_deg - front_deg + 180) % 360 - 180 == pytest.approx(0, abs=1.5)
    if shift_s:
        found_s = float(re.search(r"pose_shift_s=(-?[\d.]+\d)", said)[1])
        assert found_s == pytest.approx(-shift_s, abs=0.1)  # a lag of the search is in it


def test_a_sideways_speed_that_is_hardly_told_tells_no_unit(judged):
    found, _ = judged("sideways_noise")
    assert not found.findings


@pytest.mark.parametrize(
    ("poses", "commands", "ratio", "words"),
    [
        ("poses", "rev_per_s", 2 * np.pi, "revolutions per second"),
        ("poses_cm_named", "rad_per_s", 0.01, "100 times too small"),
    ],
)
def test_factors_of_wheel_speeds_and_of_positions_are_told_apart(
    judged, poses, commands, ratio, words
):
    with pytest.raises(LogError, match=words) as told:
        judged("wheel_factor", poses, commands, "diff_wheels")
    said = float(str(told.value).split("the robot is ")[1].split(" times")[0])
    assert said == pytest.approx(ratio, rel=0.03)  # the lag of the search is not quite the robot's


def test_revolutions_per_second_are_read_as_advised(judged):
    names = {f"w{k}_radps": f"w{k}_rps" for k in range(1, 5)}
    found, _ = judged("wheel_factor", "poses", "rev_per_s", "diff_wheels", rename=names)
    assert not found.findings


def test_metres_named_centimetres_are_read_as_advised(judged, cases, tmp_path):
    text = (cases / "wheel_factor/poses_cm_named.csv").read_text().replace("x_cm,y_cm", "x_m,y_m")
    (tmp_path / "named.csv").write_text(text)
    found, _ = judged("wheel_factor", tmp_path / "named", "rad_per_s", "diff_wheels")
    assert not found.findings


@pytest.mark.parametrize(("share", "flipped"), [("0.02", 38), ("0.03", 51)])
def test_single_frames_whose_heading_is_turned_are_left_out(judged, cases, share, flipped):
    found, _ = judged("tag_single_flips", f"poses_{share}")
    clean = np.loadtxt(cases / "tag_single_flips/poses_clean.csv", delimiter=",", skiprows=1)
    table = cases / f"tag_single_flips/poses_{share}.csv"
    turned = np.cos(np.loadtxt(table, delimiter=",", skiprows=1)[:, 4] - clean[:, 4]) < 0
    assert turned.sum() == flipped and not found.findings
    assert np.array_equal(found[0].track.segment < 0, turned)
    assert any(f"{flipped} poses" in note for note in found[0].warnings)


@pytest.mark.parametrize("share", [0.1, 0.2, 0.33])
def test_frames_that_flicker_are_left_out_up_to_a_third_and_the_others_are_not(
    judged, cases, tmp_path, share
):
    """Drawn at random, so that several come in a row; a log of a third of them is judged, too."""
    table = np.loadtxt(cases / "tag_single_flips/poses_clean.csv", delimiter=",", skiprows=1)
    turned = np.random.default_rng(7).random(len(table)) < share
    table[turned, 4] += np.pi
    header = "t_s,robot_id,x_m,y_m,theta_rad"
    np.savetxt(tmp_path / "p.csv", table, delimiter=",", header=header, comments="", fmt="%.5f")
    found, file = judged("tag_single_flips", tmp_path / "p")
    left_out = found[0].track.segment < 0
    assert left_out[turned].all() and left_out[~turned].mean() < 0.01
    assert compare(found, file).score == pytest.approx(1, abs=0.2)


@pytest.mark.parametrize(("poses", "until_s"), [("14_20", 20), ("from_20", 40)])
def test_bodies_that_a_tracker_exchanged_are_given_back_and_told(judged, cases, poses, until_s):
    found, _ = judged("bodies_swapped", f"poses_{poses}")
    from_s = 14 if until_s == 20 else 20
    assert f"R01 and R02 have each other's poses from {from_s}.0 to {until_s}.0 s" in _said(found)
    right = np.loadtxt(cases / "bodies_swapped/poses_ok.csv", delimiter=",", skiprows=1)
    for m in found:
        own = right[right[:, 1] == m.track.robot_id]
        assert m.track.pose[:, :2] == pytest.approx(own[:, 2:4], abs=1e-6)


def test_turning_by_half_is_a_stale_base_and_so_is_a_longer_lag(judged, cases, tmp_path):
    """The wheels turn the robot by half, and their lag is 0.12 s in place of 0.08."""
    judged("export_share", model="diff_wheels")
    found = tm.explain(str(tmp_path / "x.lcmlog"), str(cases / "models/diff_wheels.toml"))
    assert found.diagnosis.verdict == "refit_enough" and not found.model.effects
    assert found.model["base.yaw_gain"] == pytest.approx(0.5, rel=0.01)
    assert found.model["base.motor_lag_s"] == pytest.approx(0.12, abs=0.002)
    assert found.score < 1.1 < 50 < found.diagnosis.score


@pytest.mark.parametrize(("name", "width"), [("slow", 0.04), ("fast", 0.08)])
def test_a_dead_zone_is_found_in_a_table_of_any_speed(cases, name, width):
    folder = cases / f"{name}_table"
    file = ModelFile.load(str(folder / "model.toml"))
    sheets = load_measurements([folder / "sheet.csv"], file.model)
    assert compare(sheets, file).score > 10  # at 10 % of duty it is off by half
    (found,) = diagnose(sheets, file).findings
    (estimate,) = found.parameters
    assert (found.effect, found.certainty) == ("dead_zone", "sure")
    assert estimate.value == pytest.approx(width, abs=0.001)
