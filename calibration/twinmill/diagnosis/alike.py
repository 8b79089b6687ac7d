# SPDX-License-Identifier: Apache-2.0
"""Which robots of several are odd, and what the others have in common.

The robots themselves set the scale: one is odd if its errors or its gains are outliers among all
(median and median absolute deviation, Rousseeuw and Croux 1993).
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np

from twinmill.diagnosis.bumps import spared
from twinmill.diagnosis.evidence import State
from twinmill.diagnosis.search import Search, search
from twinmill.fitting.fit import refit
from twinmill.fitting.solve import gain_spread
from twinmill.model.freedom import Free
from twinmill.predict.problem import GAINS, Scene
from twinmill.predict.windows import Windows, rms, score_of

FEWEST = 3  # robots, below which none can be called the odd one
SPREAD = 0.06  # scatter of the logarithm of scores among robots that are alike
ODD = 3.5  # scales from the median
BUMPS = 0.1  # share of the predictions, the worst, that do not count


def robot_of(scene: Scene) -> int:
    """Its number."""
    return scene.measurement.track.robot_id


def free_gains(scenes: list) -> list:
    """The scenes, each with gains of its own if they are logs of several robots."""
    several = _count(scenes) > 1
    return [replace(s, gains_free=several) for s in scenes]


def _count(scenes: list) -> int:
    """Robots in logs; 0 if there are tables among them."""
    logs = [s for s in scenes if isinstance(s, Scene)]
    return len({robot_of(s) for s in logs}) if len(logs) == len(scenes) else 0


@dataclass(frozen=True)
class Common:
    """What the robots that are alike have in common.

    Attributes:
        scenes: all, those that stood out without their bumps.
        alike, odd: places among the scenes.
        done, state: the search over those that are alike, and where it ended.
    """

    scenes: list
    alike: list[int]
    odd: list[int]
    done: Search
    state: State


def search_alike(
    scenes: list,
    free: list[Free],
    base: list[Free],
    floors: list[np.ndarray],
    say: Callable[[str], None],
    barred: Collection[str] = (),
) -> Common:
    """Searches without the odd robots, so that what one of them has is not taken for all.

    Args:
        scenes: with a model fitted to all; those of odd robots do not take part further.
        free: of that fit.
        base: the same without the quantities of effects.
        floors: (H, 3) per scene.
        say: told in words what is being done.
        barred: effects that are not to be thought of.
    """
    out: set[int] = odd_robots(scenes, floors)
    if out:
        scenes = [spared(s) if robot_of(s) in out else s for s in scenes]
        out = odd_robots(scenes, floors)
    for last in (False, True):
        alike = [i for i, s in enumerate(scenes) if not out or robot_of(s) not in out]
        own = [scenes[i] for i in alike]
        if out:
            refit(own, free)
        held = [floors[i] for i in alike]
        done, state = search(State(own, base, held), say, barred)
        more = odd_robots(state.scenes, held)
        if last or not more:
            break
        out |= more
        scenes = [spared(s) if robot_of(s) in more else s for s in scenes]
    return Common(scenes, alike, [i for i in range(len(scenes)) if i not in alike], done, state)


def odd_robots(scenes: list[Scene], floors: list[np.ndarray]) -> set[int]:
    """Robots whose errors or gains are outliers; never as many as half of all.

    Args:
        scenes: with a model fitted to all.
        floors: (H, 3) per scene.
    """
    if _count(scenes) < FEWEST:
        return set()
    away = outlying(scenes, floors)
    for name in GAINS:
        of_gain = gains_apart(scenes, name)
        away = {i: max(z, of_gain[i]) for i, z in away.items()}
    return odd_ones(away)


def odd_ones(away: dict[int, float]) -> set[int]:
    """Robots that are more than ODD scales off: the worst, and always fewer than half."""
    worst = sorted(away, key=lambda i: -away[i])[: max(len(away) - 1, 0) // 2]
    return {i for i in worst if away[i] > ODD}


def outlying(scenes: list[Scene], floors: list[np.ndarray]) -> dict[int, float]:
    """By robot: how many scales its errors are above the median robot's.

    All over the median floor: in its own floor what sets a robot apart could count as noise.
    """
    floor = np.median(floors, axis=0)
    squares: dict[int, list[float]] = {}
    for scene in scenes:
        squares.setdefault(robot_of(scene), []).append(score_of([rms_of(scene)], [floor]) ** 2)
    size = {i: 0.5 * np.log(np.mean(s)) for i, s in squares.items()}
    middle, scale = middle_and_scale(list(size.values()))
    return {i: float((s - middle) / max(scale, SPREAD)) for i, s in size.items()}


def rms_of(scene: Scene) -> np.ndarray:
    """(H, 3) errors of the scene's model, the largest left out: bumps set no robot apart."""
    errors = Windows.of(scene.measurement.track).errors(scene)
    largest = np.nanquantile(np.abs(errors), 1 - BUMPS, axis=0)
    return rms(np.where(np.abs(errors) <= largest, errors, np.nan))


def gains_apart(scenes: list[Scene], name: str) -> dict[int, float]:
    """By robot: how many usual spreads one of its gains is from the median robot's."""
    gain: dict[int, list[float]] = {}
    for scene in scenes:
        gain.setdefault(robot_of(scene), []).append(scene.model.get(name))
    of_robot = {i: float(np.mean(g)) for i, g in gain.items()}
    middle, scale = middle_and_scale(list(of_robot.values()))
    scale = max(scale, gain_spread(scenes[0].model, name))
    return {i: abs(g - middle) / scale for i, g in of_robot.items()}


def middle_and_scale(values: list[float]) -> tuple[float, float]:
    """Median, and the standard deviation that the median absolute deviation stands for."""
    middle = np.median(values)
    return float(middle), float(1.4826 * np.median(np.abs(np.array(values) - middle)))
