# SPDX-License-Identifier: Apache-2.0
"""The camera's bits, and what cameras lack. Truth: geometry and draws by numpy, and counts."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import twinmill_native as native

from twinmill.data.camera_frames import Frames, frames_of
from twinmill.data.track import make_track
from twinmill.inference.camera_search import CameraSearch
from twinmill.inference.camera_set import CameraFitter, Lack
from twinmill.inference.cameras import NO_RAW, Cameras, judge_detections
from twinmill.model.model_file import ModelFile
from twinmill.predict.detection_errors import compare_detections
from twinmill.predict.detections import BLOCK_S, Detections, majority, thue_morse

RANGE_M, CONE_RAD, MISS, FALSE = 1.1, 0.855, 0.05, 0.1
MODEL = f"""
[base]
drive = "duty"
[sensor]
range_m = {RANGE_M}
cone_rad = {CONE_RAD}
false_negative_rate = {MISS}
false_positive_rate = {FALSE}
vote_frames = 10
"""
DURATION_S, POSE_HZ, EVERY = 32.0, 120, 3
ROBOTS = 3


def model() -> native.Model:
    return native.Model.from_toml(MODEL, "test")


def judged(cameras: list[Detections], text: str = MODEL, without=()) -> Cameras:
    return judge_detections(cameras, ModelFile.of(Path("test.toml"), text), without=without)


def paths(seed: int, robots: int = ROBOTS) -> tuple[np.ndarray, np.ndarray]:
    """(N,) s and (robots, N, 3) poses: circles and slow turns at random, within a few metres."""
    random = np.random.default_rng(seed)
    t_s = np.arange(0, DURATION_S, 1 / POSE_HZ)
    poses = []
    for _ in range(robots):
        radius, phase = random.uniform(0.3, 0.7), random.uniform(0, 7)
        place = random.normal(0, 0.3, 2)
        rate = random.uniform(0.4, 1.2) * random.choice([-1, 1])
        angle = phase + rate * t_s
        theta = angle + np.sign(rate) * np.pi / 2 + random.uniform(-1.5, 1.5)
        x, y = place[0] + radius * np.cos(angle), place[1] + radius * np.sin(angle)
        poses.append(np.column_stack([x, y, theta]))
    return t_s, np.array(poses)


def in_view(poses: np.ndarray, own: int, range_m: float, cone_rad: float, pan_rad: float):
    """(N,) bool by vectors: the angle between the camera's axis and the way to the other robot."""
    axis = poses[own, :, 2] + pan_rad
    look = np.column_stack([np.cos(axis), np.sin(axis)])
    seen = np.zeros(poses.shape[1], bool)
    for other in set(range(len(poses))) - {own}:
        to = poses[other, :, :2] - poses[own, :, :2]
        far = np.linalg.norm(to, axis=1)
        seen |= (far < range_m) & (np.sum(look * to, axis=1) > far * np.cos(cone_rad / 2))
    return seen


def vote(raw: np.ndarray, frames: int) -> np.ndarray:
    """The newest bits, more than half of them 1, one frame after the other."""
    return np.array([2 * sum(raw[max(0, k - frames + 1) : k + 1]) > min(k + 1, frames)
                     for k in range(len(raw))])  # fmt: skip


@pytest.fixture(scope="module")
def make_scenes(driven):
    """Scenes of all robots with bits drawn by a camera of the numbers given."""

    def make(seed, range_m=RANGE_M, cone_rad=CONE_RAD, pan_rad=0.0, miss=MISS, false=FALSE,
             delay_s=0.0, frames=10, has_raw=True, repeats=1,
             robots=ROBOTS) -> list[Detections]:  # fmt: skip
        random = np.random.default_rng(seed + 1000)
        t_s, poses = paths(seed, robots)
        late = round(delay_s * POSE_HZ)
        tracks = [
            make_track(replace(driven(DURATION_S), robot_id=i, pose=p), usual_radps=20)
            for i, p in enumerate(poses)
        ]
        scenes = []
        for own in range(robots):
            seen = in_view(poses, own, range_m, cone_rad, pan_rad)
            pick = np.arange(late, len(t_s), EVERY)
            raw = seen[pick - late]
            drawn = np.repeat(random.random(len(raw)), repeats)[: len(raw)]
            raw = raw ^ (drawn < np.where(raw, miss, false))
            voted = vote(raw, frames)
            frame = Frames(t_s[pick], True, raw if has_raw else raw & False, has_raw, voted)
            block = (frame.t_s // BLOCK_S).astype(int)
            scenes.append(
                Detections(f"R{own:02d}", own, "log", own, tracks, frame, np.ones(len(raw), bool),
                         0.0, 0.0, False, (1e-6, 1e-6), block, thue_morse(block))
            )  # fmt: skip
        return scenes

    return make


def test_a_perfect_camera_has_a_diagonal_confusion_matrix(make_scenes):
    result = compare_detections(make_scenes(1, miss=0, false=0), model())
    c = result.confusion
    assert c.false_negative == c.false_positive == 0
    assert c.true_positive > 100
    assert c.true_negative > 100
    assert result.vote_agreement == 1


def test_missed_and_false_frames_are_counted_where_they_were_drawn(make_scenes):
    clean, noisy = make_scenes(2, miss=0, false=0), make_scenes(2, miss=0.2, false=0.1)
    c = compare_detections(noisy, model()).confusion
    before = np.concatenate([s.frames.raw for s in clean])
    after = np.concatenate([s.frames.raw for s in noisy])
    # The model says seen where the noisy camera missed: its answer was a false positive.
    assert c.false_positive == np.sum(before & ~after)
    assert c.false_negative == np.sum(~before & after)


def test_score_is_one_if_the_rates_are_right_and_above_if_not(make_scenes):
    right = compare_detections(make_scenes(3), model()).score
    assert right == pytest.approx(1, abs=0.1)
    assert compare_detections(make_scenes(3, miss=0.4, false=0.3), model()).score > 1.5 * right


def test_majority_is_the_sum_over_all_outcomes():
    chance = np.array([0.1, 0.8, 0.3, 0.6, 0.9])
    for frames in (1, 4, 5):
        newest = chance[-frames:]
        expected = sum(
            np.prod(np.where(bits, newest, 1 - newest))
            for bits in product([False, True], repeat=frames)
            if 2 * sum(bits) > frames
        )
        assert majority(chance, frames)[-1] == pytest.approx(expected, abs=1e-12)


def test_vote_counts_as_one_frame_after_the_other(make_scenes):
    scene = make_scenes(4)[0]
    for frames in (1, 3, 10):
        assert np.array_equal(scene.voted(frames), vote(scene.frames.raw, frames))


def test_a_frame_that_several_control_steps_used_counts_once(driven):
    robot = driven(1.0)
    count = len(robot.command_t_s)
    stamp = np.floor(np.arange(count) / 3) * 0.066
    bits = (np.arange(count) // 3 % 2).astype(np.int8)
    frames = frames_of(replace(robot, frame_t_s=stamp, detected=bits, detected_raw=bits))
    assert len(frames.t_s) == -(-count // 3)
    assert np.array_equal(frames.raw, np.arange(len(frames.t_s)) % 2 == 1)
    assert frames_of(robot) is None


def test_numbers_of_several_bits_are_told_bit_by_bit(driven):
    robot = driven(1.0)
    number = (np.arange(len(robot.command_t_s)) % 8).astype(np.int8)
    frames = frames_of(replace(robot, detected=number, detected_raw=number))
    assert np.array_equal(frames.told @ [1, 2, 4], number)
    # What is calibrated is the first bit's.
    assert np.array_equal(frames.voted, number % 2 == 1)
    one = frames_of(replace(robot, detected=number % 2, detected_raw=number % 2))
    assert one.told.shape == (len(number), 1)


HIDDEN = {
    "view_range": {"range_m": 0.85 * RANGE_M},
    "view_angle": {"cone_rad": 1.3 * CONE_RAD},
    "view_pan": {"pan_rad": -0.12},
    "sensor_delay": {"delay_s": 0.1},
    "missed_detection": {"miss": MISS + 0.15 * (1 - MISS)},
    "false_detection": {"false": FALSE + 0.1 * (1 - FALSE)},
    "vote": {"frames": 14},
}
TRUE = {
    "view_range": ("factor", 0.85),
    "view_angle": ("factor", 1.3),
    "view_pan": ("pan_rad", -0.12),
    "sensor_delay": ("delay_s", 0.1),
    "missed_detection": ("rate", 0.15),
    "false_detection": ("rate", 0.1),
    "vote": ("extra_frames", 4),
}


@pytest.fixture(scope="module")
def hiding(make_scenes) -> Callable[[str], list[Detections]]:
    """Scenes with an effect hidden."""
    return lambda effect: make_scenes(50 + list(HIDDEN).index(effect), **HIDDEN[effect])


@pytest.fixture(scope="module")
def found_in(hiding) -> Callable[[str], Cameras]:
    """Judges scenes with an effect hidden, once."""
    return cache(lambda effect: judged(hiding(effect)))


@pytest.mark.parametrize("effect", HIDDEN)
def test_a_hidden_effect_is_sure_with_its_value(effect, found_in):
    found = found_in(effect)
    assert [f.effect for f in found.findings] == [effect]
    assert found.findings[0].certainty == "sure"
    assert found.verdict("model_adequate") == found.verdict("cannot_tell") == "effect_missing"
    name, true = TRUE[effect]
    value, std = found.findings[0].numbers[name]
    assert value == pytest.approx(true, abs=max(0.05 * abs(true), 4 * std))
    assert std < 0.2 * abs(true)
    assert found.after.score == pytest.approx(1, abs=0.1)


def test_a_delay_on_clocks_of_their_own_is_one_of_two(make_scenes):
    """Poses less the robot's clock are known by its motion alone, which a delay shifts as well."""
    scenes = [replace(s, clock_free=True) for s in make_scenes(53, delay_s=0.1)]
    found = judged(scenes)
    assert {*found.findings[0].group} == {"sensor_delay", "input_delay"}
    assert found.findings[0].certainty == "group"
    assert found.verdict("model_adequate") == "ambiguous"


@pytest.mark.parametrize(("effect", "clean"), [("false_detection", "false"),
                                               ("missed_detection", "miss")])  # fmt: skip
def test_a_camera_better_than_the_model_is_told_too(effect, clean, make_scenes):
    worse = MODEL.replace("rate = 0.05", "rate = 0.15")
    found = judged(make_scenes(64, robots=4, **{"miss": 0.15, clean: 0.0}), worse)
    assert [f.effect for f in found.findings] == [effect]
    assert found.findings[0].numbers["rate"][0] == pytest.approx(-1, abs=0.1)


def test_nothing_is_told_where_nothing_is_hidden(make_scenes):
    for seed in range(70, 73):
        found = judged(make_scenes(seed))
        assert not found.findings and not found.off
        assert found.verdict("model_adequate") == "model_adequate"


def test_bits_that_come_several_times_count_once(make_scenes):
    """A sum of n / m draws of weight m varies by m times that of n draws."""
    scenes = make_scenes(75, repeats=4)
    given = ModelFile.of(Path("test.toml"), MODEL)
    names = ("false_detection", "missed_detection", "view_angle", "view_pan")
    search = CameraSearch(CameraFitter(scenes, given), [Lack(name) for name in names])
    search.run()
    blocks = sum(s.block.max() + 1 for s in scenes)
    assert search.dispersion() == pytest.approx(4, rel=4 * np.sqrt(2 / blocks))
    found = judged(scenes)
    assert not found.findings and not found.off


def test_a_blind_camera_is_told_from_its_sisters(make_scenes):
    """A target is in view in a few per cent of the frames: all others look right."""
    alike, blind = (make_scenes(100, robots=4, miss=miss) for miss in (MISS, 1.0))
    found = judged([*alike[:2], blind[2], *alike[3:]])
    assert not found.findings
    (off,) = found.off
    assert off.robot_id == alike[2].robot_id
    assert off.findings[0].effect == "missed_detection"
    assert off.to_json()["effect"] == "missed_detection"
    assert off.score_before > 1.2 * off.score_others


def test_what_all_lack_is_told_beside_one_that_differs(make_scenes):
    alike, odd = (make_scenes(110, pan_rad=0.12, miss=miss) for miss in (MISS, 0.7))
    found = judged([alike[0], odd[1], *alike[2:]])
    assert [f.effect for f in found.findings] == ["view_pan"]
    assert [(o.robot_id, o.findings[0].effect) for o in found.off] == [(1, "missed_detection")]


def test_without_raw_bits_the_vote_is_not_judged(make_scenes):
    found = judged(make_scenes(90, range_m=0.7, has_raw=False))
    assert found.not_shown == {"vote": NO_RAW}
    assert found.findings[0].effect == "view_range"
    assert "voted detections alone" in found.notes[0]


def test_an_effect_that_the_model_has_is_no_news(hiding):
    """Its number is as sure as a data sheet's: 15 %."""
    own = f"{MODEL}\n[[effect]]\nname = 'missed_detection'\nrate = 0.165\n"
    found = judged(hiding("missed_detection"), own)
    assert not found.findings and not found.off


def test_a_better_model_has_what_was_found(hiding, found_in):
    found = found_in("view_pan")
    assert found.added == ("view_pan",)
    assert found.model.get("view_pan.pan_rad") == pytest.approx(-0.12, abs=0.01)
    assert compare_detections(hiding("view_pan"), found.model).score == pytest.approx(1, abs=0.1)


def test_answers_on_motion_and_cameras_are_joined(found_in):
    found = found_in("false_detection")
    rows = ("findings", "found", "ranking", "not_identifiable", "robots_off", "warnings")
    told = found.joined({"verdict": "cannot_tell", **{row: [] for row in rows}})
    assert told["verdict"] == "effect_missing"
    assert told["found"] == ["false_detection"]
    assert told["findings"] == told["camera"]
    assert told["ranking"][0]["effect"] == "false_detection"
    assert told["bits_after"]["score"] < told["bits"]["score"]
    assert [s["effect"] for s in told["bit_steps"]] == [None, "false_detection"]
