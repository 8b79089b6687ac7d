# SPDX-License-Identifier: Apache-2.0
"""A file for another simulator carries of each effect as much as it is said to."""

import ctypes.util
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from unittest.mock import ANY

import mujoco
import numpy as np
import pytest
import yaml

from twinmill.defaults import ModelFormat
from twinmill.export.carried import open_robot
from twinmill.export.model_files import WRITERS
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import catalogue_of
from twinmill_cli.main import run

SIMULATORS = Path(__file__).resolve().parents[2] / "docs/simulators.md"
FORMATS = [form for form in ModelFormat if form is not ModelFormat.JSON]
TOLD_AS = {"duty": "duties", "wheel_speed": "wheel speeds", "twist": "velocities"}
ROBOTS = [
    ("duty", "mecanum"),
    ("duty", "differential"),
    ("twist", "mecanum"),
    ("twist", "differential"),
    ("twist", "none"),
    ("twist", "ackermann"),
    ("wheel_speed", "differential"),
    ("wheel_speed", "omni3"),
]
REFUSED = {
    ModelFormat.ROS2_CONTROL: ("omni3", "none", "ackermann"),
    ModelFormat.MJCF: ("ackermann",),
}
TOP_MPS, RADIUS_M, HALF_TRACK_M = 0.4, 0.0325, 0.067
LIMIT = '[[effect]]\nname = "{}_limit"\npace_s_per_m = 2.5\n'  # 1 / TOP_MPS


@pytest.fixture
def text_of(model_text):
    """Text of a model that is told so and has such wheels."""

    def make(drive, wheels, **base):
        text = model_text("m", **base).replace('"mecanum"', f'"{wheels}"')
        if drive == "duty":
            return text
        text = text.replace("duty_pct = [0, 100]\nwheel_speed_mps = [0, 0.36]\n", "")
        return text.replace('"duty"', f'"{drive}"')

    return make


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty one to be in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def written(folder, text, to):
    """The file without its comments, and what is said not to be in it, by name."""
    (folder / "m.toml").write_text(text)
    robot = open_robot(ModelFile.load(str(folder / "m.toml")), None, None)
    made, left = WRITERS[to](robot)
    bare = re.sub(r"<!--.*?-->|^#.*?\n", "", made, flags=re.DOTALL | re.MULTILINE)
    return bare, {item.name: item for item in left}


def parameters_of(card):
    """Texts of the effect, each with one parameter that is not neutral; one if it has a formula."""
    head = f'[[effect]]\nname = "{card["name"]}"\n'
    if card["texts"]:
        yield "p0", head + "p0 = 0.05\n"
        return
    neutral = {p["name"]: p["neutral"] for p in card["parameters"]}
    for p in card["parameters"]:
        value = p["default"] if p["default"] != p["neutral"] else p["neutral"] + p["usual_size"]
        if value != p["neutral"]:
            values = neutral | {p["name"]: value}
            yield p["name"], head + "".join(f"{k} = {v}\n" for k, v in values.items())


@pytest.mark.parametrize("to", FORMATS)
@pytest.mark.parametrize(("drive", "wheels"), ROBOTS)
def test_a_file_differs_by_an_effect_exactly_if_it_is_said_to_carry_it(
    drive, wheels, to, folder, text_of
):
    """Each effect of the catalogue, each parameter of it alone."""
    text = text_of(drive, wheels)
    try:
        plain, _ = written(folder, text, to)
    except ValueError as error:
        assert wheels in REFUSED[to], error
        return
    wrong, seen = [], 0
    cards = catalogue_of(ModelFile.load("m.toml").model).values()
    for card in (c for c in cards if TOLD_AS[drive] in c["drives"]):
        for parameter, effect in parameters_of(card):
            try:
                made, left = written(folder, text + effect, to)
            except ValueError as error:
                assert wheels == "none" and "acts on single wheels" in str(error), error
                continue
            seen += 1
            item = left.get(card["name"])
            has_some = item is None or item.partly
            if has_some != (made != plain):
                said = "carried" if item is None else item.why
                wrong.append(f"{card['name']}.{parameter}: {said}, but differs: {made != plain}")
    assert not wrong, "\n".join(wrong)
    assert seen > 30


def held_by_sdformat(path):
    """Contents of a file by Gazebo's library, which reads URDF by urdfdom."""
    library = ctypes.util.find_library("sdformat12")
    if not library:
        pytest.skip("libsdformat12 is not installed (Debian: libsdformat12-12)")
    code = f"import ctypes; ctypes.CDLL('{library}').cmdPrint(b'{path}', 0, 0, 0, 17, 0)"
    return ET.fromstring(subprocess.check_output([sys.executable, "-c", code], text=True))


def export(text, to):
    """Writes `m.toml` and its file; what is said not to be in it, by name."""
    with open("m.toml", "w") as file:
        file.write(text)
    done = run(["export-model", "m.toml", "--to", to, "--out", f"m.{to}", "--force", "--json"])
    return {item["name"]: item["why"] for item in done["not_carried"]}


@pytest.mark.parametrize("to", ["urdf", "sdf"])
@pytest.mark.parametrize(
    ("drive", "wheels", "joints"),
    [
        ("twist", "mecanum", 4),
        ("twist", "differential", 4),
        ("twist", "ackermann", 2),
        ("wheel_speed", "omni3", 3),
    ],
)
def test_joints_have_the_top_speed_that_wheel_limit_tells(
    drive, wheels, joints, to, folder, text_of
):
    """Rim speed over radius, as urdfdom and sdformat read it; no joint is told another one."""
    left = export(text_of(drive, wheels, forward_gain=0.9) + LIMIT.format("wheel"), to)
    assert not {"wheel_limit", "top speed"} & set(left)
    tops = [float(v.text) for v in held_by_sdformat(folder / f"m.{to}").iter("velocity")]
    assert tops == pytest.approx([TOP_MPS / RADIUS_M] * joints, rel=1e-5)


@pytest.mark.parametrize("to", ["urdf", "sdf", "ros2_control"])
@pytest.mark.parametrize("drive", ["twist", "wheel_speed"])
def test_a_model_without_a_top_speed_says_so_and_what_to_set(drive, to, folder, text_of):
    """The sentence's advice is done by hand; then the file has limits, and nothing is said."""
    text = text_of(drive, "differential")
    (why,) = [why for name, why in export(text, to).items() if "top speed" in name]
    assert "knows none" in why
    effect = re.search(r'append (\[\[effect\]\]), (name = "\w+"), (\w+) = 1 / \(', why)
    head, name, key = effect.groups()
    assert "velocity" not in uncommented(folder / f"m.{to}")
    left = export(f"{text}\n{head}\n{name}\n{key} = {1 / TOP_MPS}\n", to)
    assert not [name for name in left if "top speed" in name]
    assert "velocity" in uncommented(folder / f"m.{to}")


def uncommented(path):
    """Its text without the comments of XML or YAML."""
    return re.sub(r"<!--.*?-->|#[^\n]*", "", path.read_text(), flags=re.DOTALL)


def limits_in(path):
    """(lowest, highest) by axis of velocity and acceleration in a file for plain wheels' drives."""
    if path.suffix == ".sdf":
        plugin = held_by_sdformat(path).find("model/plugin")
        told = {c.tag: float(c.text) for c in plugin if c.tag.startswith(("max_", "min_"))}
        names = [(f"{w}_{q}", f"min_{w}_{q}", f"max_{w}_{q}") for w in WAYS for q in QUANTITIES]
    else:
        (told,) = [
            node["ros__parameters"]
            for name, node in yaml.safe_load(path.read_text()).items()
            if name != "controller_manager"
        ]
        axes = {"linear": "linear.x", "angular": "angular.z"}
        lows = {"velocity": "min_velocity", "acceleration": "max_deceleration"}
        names = [
            (f"{w}_{q}", f"{axes[w]}.{lows[q]}", f"{axes[w]}.max_{q}")
            for w in WAYS
            for q in QUANTITIES
        ]
    return {name: (told[low], told[high]) for name, low, high in names if high in told}


WAYS, QUANTITIES = ("linear", "angular"), ("velocity", "acceleration")
RAMPS = (
    '[[effect]]\nname = "acceleration_limit"\npace_s2_per_m = 0.5\nturn_pace_s2_per_rad = 0.125\n'
)


@pytest.mark.parametrize("to", ["sdf", "ros2_control"])
def test_a_drives_limits_are_those_of_the_real_body(to, folder, text_of):
    """By hand: rims at their top, times the gain of the floor; a ramp's 1 / pace, times it."""
    text = text_of("twist", "differential", forward_gain=0.9, yaw_gain=0.8)
    turn_radps = 0.8 * TOP_MPS / HALF_TRACK_M
    wanted = {
        "wheel": {"linear_velocity": 0.9 * TOP_MPS, "angular_velocity": turn_radps},
        "speed": {"linear_velocity": 0.9 * TOP_MPS},
    }
    for limit, tops in wanted.items():
        left = export(text + LIMIT.format(limit), to)
        found = limits_in(folder / f"m.{to}")
        assert set(found) == set(tops)
        for name, top in tops.items():
            assert found[name] == pytest.approx((-top, top), rel=1e-5)
        assert any("top speed" in name for name in left) == (limit == "speed")  # it may turn faster
    assert "acceleration_limit" not in export(text + RAMPS, to)
    found = limits_in(folder / f"m.{to}")
    assert found["linear_acceleration"] == pytest.approx((-0.9 * 2, 0.9 * 2))
    assert found["angular_acceleration"] == pytest.approx((-0.8 * 8, 0.8 * 8))


def test_a_mecanum_controller_may_be_told_what_its_wheels_can(folder, text_of):
    """By hand, inverse kinematics of its radius: at each axis' limit a rim is at its top speed."""
    gains = {"forward_gain": 0.9, "sideways_gain": 0.6, "yaw_gain": 0.8}
    export(text_of("twist", "mecanum", **gains) + LIMIT.format("wheel"), "ros2_control")
    told = yaml.safe_load((folder / "m.ros2_control").read_text())
    told = told["mecanum_drive_controller"]["ros__parameters"]
    kinematics = told["kinematics"]
    lever_m = kinematics["sum_of_robot_center_projection_on_X_Y_axis"]
    for axis, arm in (("linear.x", 1), ("linear.y", 1), ("angular.z", lever_m)):
        wheel_radps = told[f"{axis}.max_velocity"] * arm / kinematics["wheels_radius"]
        assert wheel_radps == pytest.approx(TOP_MPS / RADIUS_M, rel=1e-4)
        assert told[f"{axis}.min_velocity"] == -told[f"{axis}.max_velocity"]


def test_mujoco_does_not_drive_faster_than_the_limit_either(folder, text_of):
    """Told ten times as much: rims at their top, so the body, gain of the floor by top speed."""
    for drive, limit, told in (("wheel_speed", "wheel", 120.0), ("twist", "speed", 4.0)):
        text = text_of(drive, "differential", forward_gain=0.9) + LIMIT.format(limit)
        assert f"{limit}_limit" not in export(text, "mjcf")
        data = mujoco.MjData(model := mujoco.MjModel.from_xml_path("m.mjcf"))
        data.ctrl[: 4 if drive == "wheel_speed" else 1] = told
        mujoco.mj_step(model, data, 2000)
        assert data.qvel[0] == pytest.approx(0.9 * TOP_MPS, rel=1e-3)


def test_only_what_the_model_has_is_said_to_be_left_out(folder, text_of):
    bare = text_of("twist", "mecanum", motor_lag_s=0) + LIMIT.format("wheel")
    for to in ("urdf", "sdf", "ros2_control"):
        assert export(bare, to) == ({"wheel_limit": ANY} if to == "ros2_control" else {})
    whole = text_of("twist", "mecanum", yaw_gain=0.9) + "[noise]\ndrive_mps = 0.01\n"
    left = export(whole + "[sensor]\nrange_m = 1\n", "urdf")
    assert set(left) == {
        *("gains of speed and turning", "motor lag", "noise", "sensor", "top speed")
    }
    assert "0.9 times as far in turns" in left["gains of speed and turning"]


def test_what_captures_see_is_a_frame_of_the_robot(folder, text_of):
    """The marker's place and turn, by libsdformat from SDF and by MuJoCo from MJCF alike."""
    text = text_of("twist", "differential")
    text += '[[effect]]\nname = "marker_offset"\nx_m = 0.02\ny_m = -0.01\n'
    text += '[[effect]]\nname = "heading_bias"\nbias_rad = 0.3\n'
    for to in ("urdf", "sdf", "mjcf"):
        assert not {"marker_offset", "heading_bias"} & set(export(text, to))
    model = mujoco.MjModel.from_xml_path("m.mjcf")
    site = model.site("marker")
    turned_rad = 2 * np.arctan2(site.quat[3], site.quat[0])
    frame = held_by_sdformat(folder / "m.sdf").find("model/frame[@name='marker']")
    joint = ET.parse("m.urdf").find("joint[@name='marker_joint']/origin")
    assert frame.get("attached_to") == "base_link"
    by_sdf = [float(v) for v in frame.findtext("pose").split()]
    by_urdf = [float(v) for v in f"{joint.get('xyz')} {joint.get('rpy')}".split()]
    assert [*site.pos[:2], turned_rad] == pytest.approx([0.02, -0.01, 0.3])
    for pose in (by_sdf, by_urdf):
        assert pose[:2] == pytest.approx([0.02, -0.01]) and pose[3:] == pytest.approx([0, 0, 0.3])


def test_gazebo_moves_a_robot_without_a_drive_by_what_the_page_adds(folder, text_of):
    """The library puts the page's plugin into the robot that the page's world includes."""
    export(text_of("twist", "none"), "sdf")
    shutil.move("m.sdf", "better.sdf")
    world, snippet = re.findall(r"```xml\n(.*?)```", SIMULATORS.read_text(), re.DOTALL)
    plain, _ = re.findall(r"<include>.*?</include>", world, re.DOTALL)
    (folder / "room.sdf").write_text(world.replace(plain, snippet))
    held = held_by_sdformat(folder / "room.sdf").findall("world/model")
    told = export(text_of("twist", "none"), "sdf")
    assert "stand in" in told["wheels"] and "top speed" not in told
    plugins = {one.get("name"): [p.get("name") for p in one.findall("plugin")] for one in held}
    assert plugins == {"floor": [], "m": ["gz::sim::systems::VelocityControl"], "second": []}


def test_the_systems_that_the_page_names_are_those_of_the_file(folder, text_of):
    row = r"^\| (.*?) \| \w+, `(gz-sim-[\w-]+)` \| (.*?) \|$"
    rows = re.findall(row, SIMULATORS.read_text(), re.MULTILINE)
    assert [system for _, system, _ in rows][:2] == [
        *("gz-sim-diff-drive-system", "gz-sim-mecanum-drive-system")
    ]
    for wheels, system, where in rows:
        for kind in re.findall(r"`(\w+)`", wheels):
            export(text_of("twist", kind), "sdf")
            found = [p.get("filename") for p in held_by_sdformat(folder / "m.sdf").iter("plugin")]
            assert found == ([system] if where == "in the file" else []), kind


def test_a_copy_of_a_model_that_comes_along_is_made_as_the_page_says(folder):
    """It has the comments of the installed file, which tell where the numbers come from."""
    page = SIMULATORS.read_text()
    exec(re.search(r"python -c '(.*?)'", page)[1])
    copy = (folder / "mine.toml").read_text()
    assert "# C: 65 mm wheels" in copy
    (folder / "mine.toml").unlink()
    words = re.search(r"twinmill twin (set .*? -o mine.toml)", page)[1].split()
    run(words)
    edited = (folder / "mine.toml").read_text()
    assert "mass_kg = 1.3 " in edited and "# C: 65 mm wheels" in edited
