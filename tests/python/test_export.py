# SPDX-License-Identifier: Apache-2.0
"""`twinmill export`: other programs find what LCM's own reader finds."""

import csv
import importlib
import json
import math
import shutil
import struct
import subprocess

import lcm
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
import turbopi
import yaml
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from twinmill.data.importers.import_log import ImportOptions, import_log
from twinmill.data.log import read_log
from twinmill.data.track import command_at
from twinmill.export import recording
from twinmill_cli.main import run

T0_US = 1_700_000_000_000_000


@pytest.fixture
def log(write_log, message):
    """Every type of message, two robots, one of them the twin's; a robot turns to the left."""
    events = [
        ("R01_RUN", message("run", utime_us=T0_US, source="robot", config_toml='a = "b,\\nc"')),
        (
            "SWARM_COMMAND",
            message("swarm_command", utime_us=T0_US, robot_id=-1, behavior="milling"),
        ),
        ("R01_ACK", message("ack", utime_us=T0_US + 1, robot_id=1, reason="flat, said it")),
        ("TWIN_TRUTH_R02", message("truth", utime_us=T0_US + 2, wheel_radps=[1.5, -2, 0.25, 3])),
        ("TWIN_R02_POSE", message("pose", utime_us=T0_US + 3, robot_id=2)),
    ]
    for k in range(40):
        utime_us, half_rad = T0_US + 10_000 * k, 0.02 * k
        pose = message("pose", utime_us=utime_us, robot_id=1, seq=k)
        pose.position_m = [0.1 * k, 1 / 3, 0.106]
        pose.orientation_wxyz = [math.cos(half_rad), 0.0, 0.0, math.sin(half_rad)]
        telemetry = message("telemetry", utime_us=utime_us + 5, robot_id=1, seq=k)
        telemetry.wheel_duty_pct = [k, -k, 100, -100]
        telemetry.detected, telemetry.battery_V = k // 20, math.nan
        telemetry.speed_input = telemetry.turn_input = math.nan
        events += [("R01_POSE", pose), ("R01_TELEMETRY", telemetry)]
    lost = message("pose", utime_us=T0_US + 400_000, robot_id=1, position_m=[math.nan] * 3)
    lost.valid = 0
    return write_log(*events, ("R01_POSE", lost))


def lcm_events(path):
    kinds = {k._get_packed_fingerprint(): k for n, k in vars(turbopi).items() if n.endswith("_t")}
    return [
        (e.channel, e.timestamp, kinds[e.data[:8]].decode(e.data))
        for e in lcm.EventLog(str(path), "r")
    ]


def mcap_messages(path):
    with open(path, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return list(reader.iter_decoded_messages(log_time_order=False))


def test_mcap_holds_every_field_of_every_message(log, tmp_path):
    run(["export", str(log), "--to", "mcap", "-o", str(tmp_path / "o.mcap")])
    said = lcm_events(log)
    found = [m for m in mcap_messages(tmp_path / "o.mcap") if m.schema.name.startswith("turbopi.")]
    assert len(found) == len(said) == 86
    for (channel, stamp_us, sent), got in zip(said, found, strict=True):
        assert (channel, 1000 * stamp_us) == (got.channel.topic, got.message.log_time)
        assert got.message.publish_time == 1000 * sent.utime_us
        assert got.schema.name == f"turbopi.{type(sent).__name__}"
        for field in sent.__slots__:
            value, copy = getattr(sent, field), getattr(got.decoded_message, field)
            if isinstance(value, str):
                assert copy == value
            else:
                np.testing.assert_array_equal(np.array(copy), value)


def test_foxglove_sees_the_robot_where_and_as_it_stood(log, tmp_path):
    run(["export", str(log), "--to", "mcap", "-o", str(tmp_path / "o.mcap")])
    found = mcap_messages(tmp_path / "o.mcap")
    frames = [m.decoded_message for m in found if m.schema.name == "foxglove.FrameTransform"]
    own = [f for f in frames if f.child_frame_id == "R01"]
    assert len(own) == 40 and len(frames) == 41  # the lost pose moves nothing
    turned_rad = [2 * math.atan2(f.rotation.z, f.rotation.w) for f in own]
    np.testing.assert_allclose(turned_rad, 0.04 * np.arange(40), atol=1e-12)
    np.testing.assert_array_equal([f.translation.x for f in own], 0.1 * np.arange(40))
    scenes = [m.decoded_message.entities[0] for m in found if m.channel.topic == "/scene"]
    bodies = [s for s in scenes if s.id == "R01 robot"]
    assert len(bodies[0].lines) == 2  # no view before the camera tells
    views = [s.lines[2].color for s in bodies[1:]]
    assert views[-1].g > views[-1].r  # it sees: green
    assert all(s.frame_id == "R01" for s in bodies)


@pytest.mark.parametrize(("frame_utime_us", "lines"), [(0, 2), (T0_US, 3)])
def test_foxglove_draws_a_view_where_a_camera_was_recorded(
    write_log, message, tmp_path, frame_utime_us, lines
):
    """Outline and nose in any case."""
    events = []
    for k in range(30):
        utime_us = T0_US + 10_000 * k
        said = message("telemetry", utime_us=utime_us, robot_id=1, detected=0)
        said.frame_utime_us = frame_utime_us
        pose = message("pose", utime_us=utime_us, robot_id=1)
        pose.orientation_wxyz = [1.0, 0.0, 0.0, 0.0]
        events += [("R01_POSE", pose), ("R01_TELEMETRY", said)]
    run(["export", str(write_log(*events)), "--to", "mcap", "-o", str(tmp_path / "o.mcap")])
    found = mcap_messages(tmp_path / "o.mcap")
    scenes = [m.decoded_message.entities[0] for m in found if m.channel.topic == "/scene"]
    bodies = [s for s in scenes if s.id == "R01 robot"]
    assert len(bodies[-1].lines) == lines


def test_import_reads_poses_and_commands_back(log, tmp_path):
    run(["export", str(log), "--to", "csv", "-o", str(tmp_path / "tables")])
    import_log(
        tmp_path / "tables" / "pose.csv",
        tmp_path / "tables" / "telemetry.csv",
        tmp_path / "again.lcmlog",
    )
    before, after = (read_log(path).robots[1] for path in (log, tmp_path / "again.lcmlog"))
    np.testing.assert_allclose(after.pose_t_s, before.pose_t_s, atol=1e-9)
    np.testing.assert_array_equal(after.valid, before.valid)
    np.testing.assert_allclose(after.pose, before.pose, atol=1e-12)
    at_s = before.command_t_s + 1e-6
    np.testing.assert_array_equal(
        command_at(at_s, after.command_t_s, after.command), before.command
    )


@pytest.mark.parametrize("kind", [0, 1, 2])
def test_import_reads_other_makers_commands_back(write_log, message, tmp_path, kind):
    value = [[10, -20, 30, -40], [1.5, 2.5, -3.25, 4.0], [0.3, -0.1, 0.7, 0]][kind]
    poses = [("R07_POSE", message("pose", utime_us=10_000 * k, robot_id=7)) for k in range(9)]
    drive = message("drive", robot_id=7, kind=kind, value=[float(v) for v in value])
    log = write_log(("R07_DRIVE", drive), *poses)
    run(["export", str(log), "--to", "csv", "-o", str(tmp_path / "t")])
    import_log(tmp_path / "t" / "pose.csv", tmp_path / "t" / "drive.csv", tmp_path / "again.lcmlog")
    before, after = (read_log(path).robots[7] for path in (log, tmp_path / "again.lcmlog"))
    assert after.command_kind == before.command_kind
    np.testing.assert_array_equal(after.command[0], before.command[0])


def test_csv_of_a_robot_that_starts_at_rest_has_numbers_for_readers_that_guess_by_first_rows(
    write_log, message, tmp_path
):
    """It stands for 2 s, is lost for a while, and drives; its voltage is measured now and then."""
    events = []
    for k in range(400):
        x_m, there = max(0, k - 200) * 0.003, k % 50 < 47
        pose = message("pose", utime_us=T0_US + 10_000 * k, robot_id=1, seq=k)
        pose.position_m = [x_m, 0.0, 0.0] if there else [math.nan] * 3
        pose.valid = int(there)
        told = message("telemetry", utime_us=T0_US + 10_000 * k, robot_id=1, seq=k)
        told.battery_V = 8.0 if k % 10 == 0 else math.nan
        events += [("R01_POSE", pose), ("R01_TELEMETRY", told)]
    run(["export", str(write_log(*events)), "--to", "csv", "-o", str(tmp_path / "t")])
    in_blocks = pyarrow.csv.ReadOptions(block_size=4096)  # types are those of the first
    poses = pyarrow.csv.open_csv(tmp_path / "t" / "pose.csv", in_blocks).read_all()
    assert poses["x_m"].type == poses["y_m"].type == poses["t_s"].type == pa.float64()
    assert poses["seq"].type == poses["utime_us"].type == pa.int64()
    assert poses["x_m"].null_count == poses["theta_rad"].null_count + 24 == 24
    assert poses["x_m"].to_pylist()[-4] == pytest.approx(0.003 * 196)
    volts = pd.read_csv(tmp_path / "t" / "telemetry.csv", keep_default_na=False, na_values=[""])
    assert volts["battery_V"].dtype == float and volts["battery_V"].count() == 40
    assert "nan" not in (tmp_path / "t" / "telemetry.csv").read_text()
    columns = np.genfromtxt(
        tmp_path / "t" / "pose.csv", delimiter=",", names=True
    )  # knows no quotes
    assert columns["x_m"][-4] == pytest.approx(0.003 * 196) and columns["t_s"][0] == 0


def test_parquet_keeps_integers_and_where_it_comes_from(log, tmp_path):
    run(["export", str(log), "--to", "parquet", "-o", str(tmp_path / "t")])
    assert {file.name for file in (tmp_path / "t").iterdir()} == {
        f"{name}.parquet"
        for name in ("run", "swarm_command", "ack", "truth", "twin_pose", "pose", "telemetry")
    }
    table = pq.read_table(tmp_path / "t" / "telemetry.parquet")
    stamps = [m.utime_us for channel, _, m in lcm_events(log) if channel == "R01_TELEMETRY"]
    assert table["utime_us"].to_pylist() == stamps
    assert table["fr_pct"].to_pylist() == [-k for k in range(40)]
    assert table["battery_V"].null_count == 40  # not-a-number is in no file's statistics
    assert json.loads(table.schema.metadata[b"twinmill"])["log_sha256"] == read_log(log).sha256


def test_a_log_that_breaks_off_is_read_up_to_there(log, tmp_path, capsys):
    broken = tmp_path / "broken.lcmlog"
    broken.write_bytes(log.read_bytes()[:-5])
    run(["export", str(broken), "--to", "mcap", "-o", str(tmp_path / "o.mcap"), "--json"])
    said = json.loads(capsys.readouterr().out)
    assert said["log_messages"] == 85
    assert "breaks off" in said["warnings"][0]
    found = [m for m in mcap_messages(tmp_path / "o.mcap") if m.schema.name.startswith("turbopi.")]
    assert len(found) == 85


@pytest.mark.parametrize("to", ["mcap", "csv"])
def test_bad_input_is_one_sentence_and_nothing_is_written(log, write_log, tmp_path, to):
    out = tmp_path / "o"
    strange = write_log(("CHATTER", b"12345678"), name="strange.lcmlog")
    (tmp_path / "text").write_text("t_s,x_m\n")
    before = set(tmp_path.iterdir())
    for path, sentence in (
        (tmp_path / "none", "cannot be read"),
        (tmp_path / "text", "no LCM log"),
        (strange, "no message of the types"),
    ):
        with pytest.raises(ValueError, match=sentence):
            run(["export", str(path), "--to", to, "-o", str(out)])
    with pytest.raises(ValueError, match=r"never replaced|--force"):
        run(["export", str(log), "--to", to, "-o", str(log)])
    assert set(tmp_path.iterdir()) == before


def test_same_log_same_bytes(log, tmp_path):
    out = tmp_path / "o.mcap"
    made = []
    for _ in range(2):
        run(["export", str(log), "--to", "mcap", "-o", str(out), "--force"])
        made.append(out.read_bytes())
    assert made[0] == made[1]


def test_names_of_strangers_are_plain_in_tables(write_log, message, tmp_path):
    said = message("run", utime_us=T0_US, behavior="\x1b[2J=a\nb", config_toml="a = 1\r\nb = 2\n")
    path = write_log(("R01_RUN", said), ("R01_POSE", message("pose", utime_us=T0_US, robot_id=1)))
    run(["export", str(path), "--to", "csv", "-o", str(tmp_path / "out")])
    (table,) = (tmp_path / "out").glob("*run.csv")
    with table.open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["behavior"] == "\ufffd[2J=a b"
    assert row["config_toml"] == "a = 1\ufffd\nb = 2\n"


def test_a_new_message_is_exported_with_its_fields(write_log, tmp_path, monkeypatch):
    """As one who adds a message to lcm_types/: a type that no code here knows."""
    (tmp_path / "heat_t.lcm").write_text(
        "package hot; struct heat_t { int64_t utime_us; int32_t robot_id; float motor_degC[2]; "
        "int32_t n; double spot_degC[n]; string note; byte tag[3]; place_t place; }"
    )
    (tmp_path / "place_t.lcm").write_text("package hot; struct place_t { double x_m, y_m; }")
    made = [shutil.which("lcm-gen") or pytest.skip("no lcm-gen"), "-p", "--ppath", str(tmp_path)]
    subprocess.run([*made, *map(str, tmp_path.glob("*.lcm"))], check=True)
    monkeypatch.syspath_prepend(str(tmp_path))
    hot = importlib.import_module("hot")
    heat_t = hot.heat_t
    monkeypatch.setitem(recording.TYPES, heat_t._get_packed_fingerprint(), heat_t)
    events = []
    for spots in ([1.5], [2.5, 3.5]):
        heat = heat_t()
        heat.utime_us, heat.motor_degC, heat.note = T0_US, [40.0, 41.0], "a, b"
        heat.n, heat.spot_degC = len(spots), spots
        heat.tag, heat.place = b"\n,\x00", hot.place_t()
        heat.place.x_m = 0.25
        events.append(("R01_HEAT", heat))
    run(["export", str(write_log(*events)), "--to", "csv", "-o", str(tmp_path / "out")])
    rows = list(csv.DictReader((tmp_path / "out" / "heat.csv").open()))
    assert [row["motor_degC_1"] for row in rows] == ["41.0", "41.0"]
    assert [row["spot_degC_1"] for row in rows] == ["", "3.5"]
    assert rows[0]["note"] == "a, b"
    assert rows[0]["tag"] == "0a2c00"  # a comma and a new line of a CSV they must not be
    assert rows[0]["place_x_m"] == "0.25"


def cdr(raw):
    """A reader of CDR (OMG DDS-XTypes, plain, little-endian), behind its four bytes."""
    assert raw[:2] == b"\0\1"
    place = 4

    def read(form):
        nonlocal place
        size = struct.calcsize(form)
        place += -(place - 4) % size
        place += size
        return struct.unpack_from(f"<{form}", raw, place - size)[0]

    def text():
        nonlocal place
        length = read("I")
        place += length
        return raw[place - length : place - 1].decode()

    return read, text


def test_a_ros_bag_holds_the_poses_as_other_readers_find_them(log, tmp_path):
    """By MCAP's own reader and CDR by hand."""
    run(["export", str(log), "--to", "rosbag2", "-o", str(tmp_path / "bag")])
    sent = [(s, m) for c, s, m in lcm_events(log) if c == "R01_POSE" and m.valid]
    found, kinds = [], {}
    with open(next((tmp_path / "bag").glob("*.mcap")), "rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            kinds[channel.topic] = schema.name
            if channel.topic == "/r01/pose":
                read, text = cdr(message.data)
                utime_us = read("i") * 10**6 + read("I") // 1000
                assert text() == "world"
                found.append((message.log_time, utime_us, [read("d") for _ in range(7)]))
    assert len(found) == len(sent) == 40  # and not the lost one
    for (stamp_us, pose), (log_ns, utime_us, values) in zip(sent, found, strict=True):
        assert (log_ns, utime_us) == (1000 * stamp_us, pose.utime_us)
        w, x, y, z = pose.orientation_wxyz
        assert values == [*pose.position_m, x, y, z, w]
    assert kinds["/tf"] == "tf2_msgs/msg/TFMessage"
    assert kinds["/r02/truth"] == "nav_msgs/msg/Odometry"
    assert kinds["/twin_r02/pose"] == "geometry_msgs/msg/PoseStamped"


@pytest.mark.parametrize("kind", [0, 1, 2])
def test_a_ros_bag_can_be_imported(kind, write_log, message, tmp_path):
    """Poses and commands of each kind come back, and the bag is listed."""
    values = np.array([[10.0 + k, -20.0, 30.5, 0.0] for k in range(40)])
    events = []
    for k, value in enumerate(values):
        utime_us = T0_US + 25_000 * k
        pose = message("pose", utime_us=utime_us, robot_id=3, position_m=[0.01 * k, 0.5, 0.1])
        drive = message("drive", utime_us=utime_us, robot_id=3, kind=kind, value=value.tolist())
        events += [("R03_POSE", pose), ("R03_DRIVE", drive)]
    run(["export", str(write_log(*events)), "--to", "rosbag2", "-o", str(tmp_path / "bag")])
    topic = {0: "/r03/duty_pct", 1: "/r03/wheels", 2: "/r03/cmd_vel"}[kind]
    options = ImportOptions(
        pose_topics=("/r03/pose",), command_topics=(topic,), receive_stamps=kind == 0
    )
    import_log(None, None, tmp_path / "again.lcmlog", bag=tmp_path / "bag", options=options)
    robot = read_log(tmp_path / "again.lcmlog").robots[3]
    assert robot.command_kind == ("duty", "wheel_speed", "twist")[kind]
    np.testing.assert_allclose(robot.command, values / (100 if kind == 0 else 1))
    np.testing.assert_allclose(robot.pose[:, 0], 0.01 * np.arange(40))


@pytest.mark.parametrize("to", ["mcap", "rosbag2"])
def test_what_is_said_to_be_written_is_what_mcaps_own_reader_counts(log, tmp_path, to, capsys):
    run(["export", str(log), "--to", to, "-o", str(tmp_path / "o"), "--json"])
    said = json.loads(capsys.readouterr().out)
    path = tmp_path / "o" if to == "mcap" else next((tmp_path / "o").glob("*.mcap"))
    with open(path, "rb") as stream:
        told = make_reader(stream).get_summary()
    counts = told.statistics.channel_message_counts
    assert said["written"] == {told.channels[k].topic: n for k, n in counts.items()}
    assert said["messages"] == told.statistics.message_count
    if to == "rosbag2":
        listed = yaml.safe_load((tmp_path / "o/metadata.yaml").read_text())
        assert said["messages"] == listed["rosbag2_bagfile_information"]["message_count"]
    run(["export", str(log), "--to", to, "-o", str(tmp_path / "o"), "--force"])
    words = f"{sum(counts.values())} messages in {len(counts)} topics: "
    assert capsys.readouterr().out.startswith(words)


def test_what_ros_has_no_messages_for_is_said(log, tmp_path, capsys):
    run(["export", str(log), "--to", "rosbag2", "-o", str(tmp_path / "bag"), "--json"])
    said = json.loads(capsys.readouterr().out)["warnings"]
    assert any("R01_ACK, SWARM_COMMAND" in words for words in said)
    with pytest.raises(ValueError, match="bag: exists"):
        run(["export", str(log), "--to", "rosbag2", "-o", str(tmp_path / "bag")])
    run(["export", str(log), "--to", "rosbag2", "-o", str(tmp_path / "bag"), "--force"])
