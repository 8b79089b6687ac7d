# SPDX-License-Identifier: Apache-2.0
"""Halves of a log: balanced whatever the rhythm of the commands, and none leaks into the other."""

from itertools import pairwise

import numpy as np
import pytest

from twinmill.predict.folds import MARGIN_S, halves, step_mask, window_mask
from twinmill.predict.problem import Scene
from twinmill.predict.residual import StepGrid
from twinmill.predict.windows import Windows

OFFSET_S = 0.07
DRIVE, REST = 120, 72  # control steps of 1/48 s: a drive every 4 s


@pytest.fixture(scope="module")
def scene_of(tanh_robot, measure, model_file):
    """A scene of a script whose clock offset is known; noise plays no part."""

    def make(script_pct):
        run = measure(tanh_robot(offset_s=OFFSET_S), script_pct=script_pct)
        model = model_file(extra=f"[clock]\noffset_s = {OFFSET_S}\n").model
        return Scene(run, model, StepGrid.of(run), False)

    return make


@pytest.fixture(scope="module")
def ladder(scene_of):
    """16 drives: forward and backward in turn, at duties that fall from drive to drive."""
    levels = [100, -100, 90, -90, 80, -80, 70, -70, 60, -60, 50, -50, 40, -40, 30, -30]
    rows = [[(level,) * 4] * DRIVE + [(0,) * 4] * REST for level in levels]
    return scene_of(np.concatenate(rows)), levels


def of_drives(scene, count):
    """Half of each drive, by a pose in its middle."""
    start_s = 0.5 + (DRIVE + REST) / 48 * np.arange(count) + DRIVE / 96 + OFFSET_S
    return halves(scene)[np.searchsorted(scene.measurement.track.pose_t_s, start_s)]


def test_drives_go_to_the_halves_by_thue_and_morse(ladder):
    scene, levels = ladder
    # Thue 1906, OEIS A010060.
    assert of_drives(scene, 16).tolist() == [0, 1, 1, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 1, 1, 0]
    assert len(levels) == 16


def test_both_halves_drive_forward_and_backward_fast_and_slow(ladder):
    scene, levels = ladder
    half, levels = of_drives(scene, 16), np.array(levels)
    for which in (0, 1):
        own = levels[half == which]
        assert np.count_nonzero(own > 0) == np.count_nonzero(own < 0) == 4
        # Prouhet 1851: halves of 2^4 members agree in sum and in sum of squares.
        assert own.sum() == levels.sum() / 2
        assert np.square(own).sum() == np.square(levels).sum() / 2


def test_a_drive_is_in_one_half_from_rest_to_rest(ladder):
    scene, _ = ladder
    t_s, half = scene.measurement.track.pose_t_s, halves(scene)
    changed_s = t_s[1:][half[1:] != half[:-1]]
    starts_s = 0.5 + (DRIVE + REST) / 48 * np.arange(16) + OFFSET_S
    nearest = np.abs(changed_s[:, None] - starts_s).min(axis=1)
    assert len(changed_s) and nearest.max() <= 0.1 + 0.01  # the robot stands before it


def test_no_fitted_step_is_near_the_other_half(ladder):
    scene, _ = ladder
    half = halves(scene)
    t_s = scene.grid.t_s
    for which in (0, 1):
        fitted = step_mask(scene, half, which)
        other = half[scene.grid.source] != which
        assert fitted.any() and not np.any(fitted & other)
        # Noise and wheels remember the past: what counts is how long ago the other half ended.
        before = np.searchsorted(t_s[other], t_s[fitted]) - 1
        since_s = t_s[fitted][before >= 0] - t_s[other][before[before >= 0]]
        assert since_s.min() >= MARGIN_S
    masks = [step_mask(scene, half, which) for which in (0, 1)]
    assert not np.any(masks[0] & masks[1])
    assert np.mean(masks[0] | masks[1]) > 0.9


def test_judged_predictions_stay_in_their_half_all_the_way(ladder, scene_of):
    quick = np.concatenate([[(60 + i,) * 4] * 60 + [(0,) * 4] * 40 for i in range(20)])
    for scene in (ladder[0], scene_of(quick)):
        half = halves(scene)
        windows = Windows.of(scene.measurement.track)
        for which in (0, 1):
            judged = window_mask(windows, half, which)
            assert judged.any()
            for w, h in np.argwhere(judged):
                assert np.all(half[windows.starts[w] : windows.ends[w, h] + 1] == which)


def test_without_drives_a_log_is_cut_into_blocks(scene_of):
    random = np.random.default_rng(2)
    never_still = np.repeat(random.choice([-80, -50, 50, 80], (60, 1)), 30, axis=0) * np.ones(
        4, int
    )
    scene = scene_of(never_still)
    half, t_s = halves(scene), scene.measurement.track.pose_t_s
    edges = [t_s[0], *t_s[1:][half[1:] != half[:-1]], t_s[-1]]
    lengths_s = [b - a for a, b in pairwise(edges)]
    assert 0.3 < half.mean() < 0.7
    # Thue and Morse never write a letter three times: no stretch is longer than two blocks of 4 s.
    assert max(lengths_s) < 8 + 0.02
