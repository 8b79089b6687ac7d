# SPDX-License-Identifier: Apache-2.0
"""The robot's program drives the twin.

The twin draws what its robot sees, the program in the guest decides, and the bytes that its motor
board takes drive the twin's robot: the very run of the twin by itself.
"""

import itertools
import os
import socket
import statistics
import struct
import subprocess

import lcm
import pytest
import turbopi
from found_swarm import BITS, find_mill, metrics_of, swarm_words
from rig import BUILD
from robot import SIGNS, Robot

TWIN_RUN = os.environ.get("TWIN_RUN")
ONE_BIT = (
    *("--plant", "planar", "--sensor", "camera", "--n", "2", "--spread-m", "0.7"),
    *("--behavior", "milling"),
    *("--duration-s", "6", "--seed", "5"),
)
# The host may think as long before the program takes the camera for frozen.
PATIENCE_MS = 2000
ANSWER = struct.Struct("<I4b")  # to the twin: frames taken so far, four duties


def read(log):
    """All but what the robots say of their configuration, which names the command line."""
    events = lcm.EventLog(str(log), "r")
    return [(e.timestamp, e.channel, e.data) for e in events if not e.channel.endswith("_RUN")]


def stand_in(folder):
    """Makes a program that the twin starts in the place of the robot's. It notes how."""
    program = folder / "turbopi"
    program.write_text(
        f'#!/bin/sh\necho "$@" >{folder}/words.part\nmv {folder}/words.part {folder}/words\n'
        "exec sleep 600\n"
    )
    program.chmod(0o755)
    return program


def answer_frames(robot, twin, frame_bytes):
    """Shows the robot each of the twin's frames and sends back its board's bytes, to the end.

    Returns:
        How long each frame took to the last motor byte (guest, s).
    """
    delays_s = []
    for number in itertools.count(1):
        frame = twin.recv(frame_bytes, socket.MSG_WAITALL)
        if len(frame) < frame_bytes:
            return delays_s
        shown_s = robot.show(frame)
        robot.rig.wait(lambda number=number: robot.telemetry()[-1].frame_seq >= number)
        assert robot.telemetry()[-1].frame_seq == number, "a frame was lost"
        duties = [sign * wire for sign, wire in zip(SIGNS, robot.wire(), strict=True)]
        twin.sendall(ANSWER.pack(number, *duties))
        delays_s.append(robot.rig.duties[-1].t_s - shown_s)


def drive_twin(rig, words, pairs):
    """Takes the place of the stand-in, which was started with these words.

    Args:
        rig: the guest.
        words: the command line.
        pairs: further settings of the program in the guest.
    """
    settings = dict(word.split("=") for word in words if "=" in word)
    path = next(word for word in words if word.startswith("stub:unix:")).removeprefix("stub:unix:")
    size_px = int(settings["width_px"]), int(settings["height_px"])
    pairs = {
        **pairs,
        **{key: settings[key] for key in ("width_px", "height_px", "vote_frames")},
        "frame_timeout_ms": PATIENCE_MS,
        "watchdog_ms": PATIENCE_MS,
    }
    arguments = itertools.chain(*(("--set", f"{key}={value}") for key, value in pairs.items()))
    with (
        Robot(rig, "--start", *arguments, size_px=size_px) as robot,
        socket.socket(socket.AF_UNIX) as twin,
    ):
        # What it saw before the twin's first frame is forgotten.
        rig.wait(lambda: any(t.frame_utime_us for t in robot.telemetry()))
        rig.wait(lambda: not robot.telemetry()[-1].frame_utime_us)
        twin.connect(path)
        delays_s = answer_frames(robot, twin, 2 * size_px[0] * size_px[1])
    ms = [1e3 * delay_s for delay_s in delays_s]
    print(
        f"hil: {len(ms)} frames of {size_px[0]}x{size_px[1]}; frame to last motor byte: median"
        f" {statistics.median(ms):.1f} ms, most {max(ms):.1f} ms"
    )


def run_both(rig, folder, swarm, pairs, by_itself=()):
    """The twin by itself, and its first robot driven by the guest. Returns the logs' paths."""
    alone, looped = folder / "alone.lcmlog", folder / "looped.lcmlog"
    command = [TWIN_RUN, *swarm, "--log"]
    subprocess.run([*command, alone, *by_itself], check=True, capture_output=True)
    console = (BUILD / "twin.log").open("w")
    with subprocess.Popen(
        [*command, looped, "--hil", "1", "--firmware", stand_in(folder)], stderr=console
    ) as twin:
        try:
            rig.wait((folder / "words").exists)
            drive_twin(rig, (folder / "words").read_text().split(), pairs)
            assert twin.wait(timeout=30) == 0
        finally:
            twin.kill()
    return alone, looped


needs_twin = pytest.mark.skipif(not TWIN_RUN, reason="TWIN_RUN does not name the twin's program")


@needs_twin
def test_twin_driven_by_the_guest_is_the_twin_byte_for_byte(rig, tmp_path):
    alone, looped = run_both(rig, tmp_path, ONE_BIT, {})
    assert read(looped) == read(alone)
    said = [turbopi.telemetry_t.decode(e[2]) for e in read(alone) if e[1] == "R00_TELEMETRY"]
    # A run in which the robot turns both ways, so that equal means something.
    assert len({tuple(t.wheel_duty_pct) for t in said}) > 1


@needs_twin
def test_a_mill_of_two_bits_that_was_found_is_one_in_twin_and_guest(rig, tmp_path):
    found, name = find_mill(tmp_path)
    tables = found / "behaviors.toml"
    (rows,) = (row for row in tables.read_text().splitlines() if row.startswith(f"{name} ="))
    pairs = {f"bit{k + 1}": sector for k, sector in enumerate(BITS)}
    pairs["table"] = rows.partition("=")[2].strip(' "')
    swarm = (*swarm_words(found, name, tables), "--duration-s", "24")
    # The first robot's program has drawn frames to look at, on this machine and then in the guest.
    alone, looped = run_both(rig, tmp_path, swarm, pairs, ("--hil", "1"))
    assert read(looped) == read(alone)
    said = metrics_of(looped, found)
    assert said["class"] == metrics_of(alone, found)["class"] == "milling"
    assert {len(shares) for shares in said["bits"].values()} == {2}
