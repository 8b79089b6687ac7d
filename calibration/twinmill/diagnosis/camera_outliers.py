# SPDX-License-Identifier: Apache-2.0
"""Cameras that differ from those of the other robots: which, in what, and how surely."""

from collections.abc import Callable, Collection

import numpy as np
import twinmill_native as native

from twinmill.chance import t_above
from twinmill.diagnosis.outliers import Outlier, middle_and_scale, odd_ones
from twinmill.diagnosis.search import search
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.trials import camera_state
from twinmill.model.parameters import ParameterEstimate, instance_of
from twinmill.predict.detection_errors import DetectionComparison, compare_detections
from twinmill.predict.detections import Detections


def odd_cameras(cameras: list[Detections], model: native.Model) -> set[int]:
    """Robots whose detections fit the model much worse than the others'; never half."""
    return odd_ones(camera_outliers(cameras, model))


def camera_outliers(cameras: list[Detections], model: native.Model) -> dict[int, float]:
    """By robot: how many scales its detections' errors are above the median robot's.

    Over all frames, or over those with a robot in view if they say more: a camera that sees nothing
    is right in all the others.
    """
    found = compare_detections(cameras, model)
    if found is None:
        return {}
    robots = np.array([s.robot_id for s in cameras])[found.robot]
    over_all = _apart(found, robots, np.ones(len(robots), bool), SETTINGS.camera_spread)
    in_view = _apart(found, robots, found.in_view, SETTINGS.camera_spread_in_view)
    return {i: max(over_all[i], in_view[i]) for i in over_all}


def _apart(
    found: DetectionComparison, robots: np.ndarray, which: np.ndarray, spread: float
) -> dict[int, float]:
    """By robot: scales from the median, of the errors of its frames among (K,) bool `which`."""
    squares = (found.measured - found.predicted) ** 2
    variance = found.predicted * (1 - found.predicted)
    size = {}
    for i in np.unique(robots):
        own = which & (robots == i)
        # As if there were one more frame, that errs as it should: few frames prove little.
        size[int(i)] = 0.5 * np.log((1 + squares[own].sum()) / (1 + variance[own].sum()))
    middle, scale = middle_and_scale(list(size.values()))
    return {i: float((s - middle) / max(scale, spread)) for i, s in size.items()}


def judge_cameras(
    alike: list[Detections],
    odd: list[Detections],
    model: native.Model,
    *,
    progress: Callable[[str], None],
    excluded: Collection[str] = (),
) -> list[Outlier]:
    """Says of each odd camera what is different, with the model of the others held.

    Args:
        alike: frames of the others.
        odd: frames of the odd ones.
        model: with all effects that were found for the others.
        progress: told in words what is being done.
        excluded: effects that are not considered.
    """
    away = camera_outliers([*alike, *odd], model)
    others = float(np.sqrt(np.mean(np.square(_scores(alike, model)))))
    off = []
    for robot_id in sorted({s.robot_id for s in odd}):
        if away[robot_id] < SETTINGS.odd:
            continue
        progress(f"the camera of robot {robot_id} differs: looking for what it is")
        own = [s for s in odd if s.robot_id == robot_id]
        off.append(_judge_camera(own, model, excluded=excluded, away=away, others=others))
    return off


def _judge_camera(
    own: list[Detections],
    model: native.Model,
    *,
    excluded: Collection[str],
    away: dict[int, float],
    others: float,
) -> Outlier:
    robot_id, count = own[0].robot_id, len(away)
    done = search(camera_state(own, model.for_robot(robot_id), excluded), known=0.0)
    before, after = (trial.held_score for trial in (done.rounds[0].before, done.last))
    first = done.rounds[0].accepted
    p_value = count * (
        done.rounds[0].p_value(first) if first else t_above(away[robot_id], count - 1)
    )
    parameters = [e for e in done.last.fit.estimates if instance_of(e.name) in done.found]
    told = f"the detections of its camera err {before:.2f} times as much as they should with the "
    told += f"model of all, those of the others {others:.2f} times; "
    told += (
        f"{' and '.join(done.found)} of its own makes it {after:.2f}"
        + "".join(f"; {trial.names[0]} would do as well" for trial in done.rounds[0].tied)
        if done.found
        else "no effect of the catalogue explains it"
    )
    return Outlier(
        robot_id=robot_id,
        effect=" + ".join(done.found) or None,
        parameters=parameters,
        score_before=before,
        score_after=after,
        score_others=others,
        p_value=float(min(1.0, p_value)),
        sentence=_plain(robot_id, parameters),
        why=told,
        smallest_shown={},
        beside=[],
    )


def _plain(robot_id: int, parameters: list[ParameterEstimate]) -> str:
    label = f"R{robot_id:02d}"
    if not parameters:
        return f"The camera of {label} differs, and no effect of the catalogue explains how."
    return f"{label}: {', '.join(f'{e.name} {e.value:.3g}' for e in parameters)}."


def _scores(cameras: list[Detections], model: native.Model) -> list[float]:
    """Brier score over its expectation, of each robot that could be judged."""
    found = compare_detections(cameras, model)
    return [score for *_, score in found.by_robot()] if found else []
