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
from twinmill.report.comparisons import advice

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


@pytest.mark.parametrize("lever_m", [(0.3, 0.0), (1.8, 0.0), (0.0, -1.5), (-2.5, 0.7)])
@pytest.mark.parametrize(("factor", "unit"), [(1.0, None), (2 * np.pi, "revolutions per second")])
def test_a_point_far_off_the_axle_belies_no_unit_of_the_wheels(
    cases, tmp_path, lever_m, factor, unit
):
    """Wheels of 50 mm, which an import without a model tells from the turns about the axle."""
    poses = _of_another_point(cases, tmp_path, lever_m)
    table = np.loadtxt(cases / "lever_as_swap/wheels.csv", delimiter=",", skiprows=1)
    table[:, 2:] /= factor
    header = "t_s,robot_id,w1_radps,w2_radps,w3_radps,w4_radps"
    np.savetxt(tmp_path / "w.csv", table, delimiter=",", header=header, comments="", fmt="%.5f")
    tables = tmp_path / f"{poses.name}.csv", tmp_path / "w.csv"
    said = " ".join(import_log(*tables, tmp_path / "x.lcmlog")["warnings"])
    assert "the wheel speeds are not" in said if unit else "wheel speeds" not in said
    assert unit is None or f"{unit}, on wheels of 50 mm" in said


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
def test_a_lever_of_any_length_is_named_and_found_to_a_millimetre_or_two_in_a_thousand(
    judged, cases, tmp_path, lever_m, commands
):
    off_m = max(1e-3, 2e-3 * np.hypot(*lever_m))
    poses = _of_another_point(cases, tmp_path, lever_m)
    model = "twist" if commands == "commands" else "diff_wheels"
    runs, file = judged("lever_as_swap", poses, commands, model)
    found = diagnose(runs, file).answer.findings[0]
    assert (found.effect, found.certainty) == ("marker_offset", "sure")
    assert [value for value, _ in found.numbers.values()] == pytest.approx(lever_m, abs=off_m)
    out = tmp_path / "better.toml"
    added = add("marker_offset", runs, file, out=out, command="add")
    again = fit(runs, ModelFile.load(str(out)), out=tmp_path / "again.toml", command="fit")
    for told in (added.added, [p for p in again.parameters if "marker" in p.name]):
        assert [p.value for p in told] == pytest.approx(lever_m, abs=off_m)


@pytest.mark.parametrize("drive", "abc")
def test_a_smooth_drive_with_slip_does_not_belie_one_clock(judged, drive):
    found, _ = judged("smooth_one_clock", f"poses_{drive}", f"commands_{drive}")
    assert not found.findings and found[0].same_clock


@pytest.mark.parametrize(
    ("folder", "poses", "commands"),
    [("lever_as_swap", "poses_0.5m", "commands"), ("smooth_one_clock", "poses_a", "commands_a")],
)
def test_where_a_robot_is_missed_accuses_no_effect(judged, folder, poses, commands):
    """Off while commands change, both of them: by a lever, and by slip; none by a lag or delay."""
    found, file = judged(folder, poses, commands)
    said = advice(compare(found, file))
    assert "while the robot is changing" in said and "`twinmill diagnose` names" in said
    assert not any(entry["name"] in said for entry in native.catalogue())


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


def _in_inches(cases, folder, word="x_m,y_m"):
    """The poses in inches of 25.4 mm (by definition), under names that say m, or another unit."""
    table = np.loadtxt(cases / "wheel_factor/poses.csv", delimiter=",", skiprows=1)
    table[:, 2:4] /= 0.0254
    header = f"t_s,robot_id,{word},theta_rad"
    np.savetxt(folder / "inch.csv", table, delimiter=",", header=header, comments="", fmt="%.5f")
    return folder / "inch"


def test_inches_are_told_and_read_as_advised(judged, cases, tmp_path):
    tables = _in_inches(cases, tmp_path), "rad_per_s", "diff_wheels"
    with pytest.raises(LogError, match="positions are in inches, or in centimetres and the robot"):
        judged("wheel_factor", *tables)
    names = {"x_m": "x_inch", "y_m": "y_inch"}
    found, _ = judged("wheel_factor", *tables, rename=names, force=True)
    assert not found.findings


def test_without_a_model_wheels_of_another_size_may_be_positions_in_another_unit(cases, tmp_path):
    """Wheels of 50 mm that seem to be of 50 / 0.0254 mm."""
    tables = _in_inches(cases, tmp_path), cases / "wheel_factor/rad_per_s.csv"
    poses = tables[0].with_suffix(".csv")
    said = " ".join(import_log(poses, tables[1], tmp_path / "x.lcmlog")["warnings"])
    assert "or the positions not in m" in said and "positions in inches, on wheels of 50 mm" in said


@pytest.mark.parametrize("names", ["x_inch,y_inch", "X [in],Y [in]"])
def test_columns_in_inches_are_read(judged, cases, tmp_path, names):
    found, _ = judged(
        "wheel_factor", _in_inches(cases, tmp_path, names), "rad_per_s", "diff_wheels"
    )
    x_m = np.loadtxt(cases / "wheel_factor/poses.csv", delimiter=",", skiprows=1)[:, 2]
    np.testing.assert_allclose(found[0].track.pose[:, 0], x_m, atol=1e-5)


def test_counts_of_an_encoder_are_no_stamps_in_milliseconds(judged, cases, tmp_path):
    """A count of 2048 in a turn is 0.0031 rad: way and turns are so much less than told."""
    table = np.loadtxt(cases / "wheel_factor/rad_per_s.csv", delimiter=",", skiprows=1)
    table[:, 2:] *= 2048 / (2 * np.pi)
    header = "t_s,robot_id,w1_radps,w2_radps,w3_radps,w4_radps"
    np.savetxt(tmp_path / "w.csv", table, delimiter=",", header=header, comments="", fmt="%.5f")
    with pytest.raises(LogError, match="another unit; or the stamps are in ms") as told:
        judged("wheel_factor", "poses", tmp_path / "w", "diff_wheels")
    factor = float(re.search(r"wheel_factor=([\d.]+\d)", str(told.value))[1])
    assert factor == pytest.approx(2 * np.pi / 2048, rel=0.1)  # the path cuts its corners short
    tables = "poses", tmp_path / "w", "diff_wheels"
    found, _ = judged("wheel_factor", *tables, wheel_factor=2 * np.pi / 2048, force=True)
    assert not found.findings


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


def _flickering(cases, path, by_rad, share, *, seed, every=1):
    """Writes poses of which a share, drawn at random, is turned; (N,) bool: which."""
    table = np.loadtxt(cases / "tag_single_flips/poses_clean.csv", delimiter=",", skiprows=1)
    table = table[::every]
    turned = np.random.default_rng(seed).random(len(table)) < share
    table[turned, 4] += by_rad
    header = "t_s,robot_id,x_m,y_m,theta_rad"
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.5f")
    return turned


@pytest.mark.parametrize(
    ("by_deg", "share", "every"),
    [(180, 0.3, 2), (90, 0.08, 1), (-120, 0.1, 1), (90, 0.15, 2)],
    ids=["half at 15 Hz", "quarter", "third", "quarter at 15 Hz"],
)
def test_frames_turned_by_any_angle_are_left_out_at_any_rate(
    judged, cases, tmp_path, by_deg, share, every
):
    turned = _flickering(cases, tmp_path / "p.csv", np.radians(by_deg), share, seed=10, every=every)
    found, file = judged("tag_single_flips", tmp_path / "p")
    left_out = found[0].track.segment < 0
    assert left_out[turned].all() and left_out[~turned].mean() < 0.12
    assert compare(found, file).score == pytest.approx(1, abs=0.2)


@pytest.mark.parametrize("share", [0.1, 0.2, 0.33])
def test_frames_that_flicker_are_left_out_up_to_a_third_and_the_others_are_not(
    judged, cases, tmp_path, share
):
    """Drawn at random, so that several come in a row; a log of a third of them is judged, too."""
    turned = _flickering(cases, tmp_path / "p.csv", np.pi, share, seed=7)
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
    found = diagnose(sheets, file)
    (first,) = found.answer.findings
    assert (first.effect, first.certainty) == ("dead_zone", "sure")
    assert first.numbers["width"][0] == pytest.approx(width, abs=0.001)
    assert found.after.score < 1.2  # a line through the medians leaves 0.3 %, about its scatter
