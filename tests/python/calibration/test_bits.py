# SPDX-License-Identifier: Apache-2.0
"""The camera's bits. Truth: geometry and draws by numpy here, enumeration, and counts."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import twinmill_native as native

from twinmill.data.camera_frames import Frames, frames_of
from twinmill.data.track import make_track
from twinmill.diagnosis.camera_outliers import odd_cameras
from twinmill.diagnosis.cameras import camera_findings, not_shown
from twinmill.diagnosis.rounds import Search
from twinmill.diagnosis.search import search
from twinmill.diagnosis.trials import camera_state
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
ROBOTS = 4


def model() -> native.Model:
    return native.Model.from_toml(MODEL, "test")


def paths(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(N,) s and (ROBOTS, N, 3) poses: circles and slow turns at random, within a few metres."""
    random = np.random.default_rng(seed)
    t_s = np.arange(0, DURATION_S, 1 / POSE_HZ)
    poses = []
    for _ in range(ROBOTS):
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


def searched(cameras: list[Detections], given: native.Model, excluded=()) -> Search:
    return search(camera_state(cameras, given, excluded), known=0.0)


@pytest.fixture
def make_scenes(driven):
    """Scenes of all robots with bits drawn by a camera of the numbers given."""

    def make(seed, range_m=RANGE_M, cone_rad=CONE_RAD, pan_rad=0.0, miss=MISS, false=FALSE,
             delay_s=0.0, frames=10, has_raw=True) -> list[Detections]:  # fmt: skip
        random = np.random.default_rng(seed + 1000)
        t_s, poses = paths(seed)
        late = round(delay_s * POSE_HZ)
        tracks = [
            make_track(replace(driven(DURATION_S), robot_id=i, pose=p), usual_radps=20)
            for i, p in enumerate(poses)
        ]
        scenes = []
        for own in range(ROBOTS):
            seen = in_view(poses, own, range_m, cone_rad, pan_rad)
            pick = np.arange(late, len(t_s), EVERY)
            raw = seen[pick - late]
            raw = raw ^ (random.random(len(raw)) < np.where(raw, miss, false))
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
    "view_range.factor": 0.85,
    "view_angle.factor": 1.3,
    "view_pan.pan_rad": -0.12,
    "sensor_delay.delay_s": 0.1,
    "missed_detection.rate": 0.15,
    "false_detection.rate": 0.1,
    "vote.extra_frames": 4,
}


@pytest.mark.parametrize("effect", HIDDEN)
def test_a_hidden_effect_is_named_with_its_value(effect, make_scenes):
    done = searched(make_scenes(50 + list(HIDDEN).index(effect), **HIDDEN[effect]), model())
    assert done.found == [effect]
    first = camera_findings(done)[0].parameters[0]
    true, sampling = TRUE[first.name], 4 * first.std if np.isfinite(first.std) else 0.0
    assert first.value == pytest.approx(true, abs=max(0.05 * abs(true), sampling))
    assert sampling < 0.5 * abs(true)


@pytest.mark.parametrize(("effect", "clean"), [("false_detection", "false"),
                                               ("missed_detection", "miss")])  # fmt: skip
def test_a_camera_better_than_the_model_is_named_too(effect, clean, make_scenes):
    worse = native.Model.from_toml(MODEL.replace("rate = 0.05", "rate = 0.15"), "test")
    done = searched(make_scenes(64, **{"miss": 0.15, clean: 0.0}), worse)
    assert done.found == [effect]
    assert camera_findings(done)[0].parameters[0].value == pytest.approx(-1, abs=0.05)


def test_nothing_is_named_where_nothing_is_hidden(make_scenes):
    """Each log may name something with a chance of 5 %: 2 of 5 would be one case in 45."""
    named = [searched(make_scenes(seed), model()).found for seed in range(70, 75)]
    assert sum(bool(n) for n in named) < 2


def test_a_blind_camera_is_told_from_its_sisters(make_scenes):
    # A target is in view in a few per cent of the frames: all others look right.
    for seed in range(8):
        alike, blind = make_scenes(100 + seed), make_scenes(100 + seed, miss=1.0)
        assert odd_cameras(alike, model()) == set()
        assert odd_cameras([*alike[:2], blind[2], alike[3]], model()) == {alike[2].robot_id}


def test_without_raw_bits_the_vote_is_not_judged(make_scenes):
    others = set(HIDDEN) - {"view_range", "vote"}
    scenes = make_scenes(90, range_m=0.7, has_raw=False)
    done = searched(scenes, model(), excluded={*others, "occlusion"})
    assert "vote" in dict(not_shown(done, scenes))
    assert done.found[:1] == ["view_range"]
