# SPDX-License-Identifier: Apache-2.0
"""What is different in an odd robot.

The effects of the catalogue are tried on it alone, with the model of the others held, and judged on
drives that were not fitted to. One that the others have too, or vary in as much, is not what sets
it apart.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm, t

from twinmill.diagnosis.alike import ODD, gains_apart, middle_and_scale, outlying, rms_of, robot_of
from twinmill.diagnosis.evidence import PRECISION, ROUNDS, State, Trial, attempt, grown
from twinmill.diagnosis.search import search
from twinmill.fitting.solve import Solution, solve
from twinmill.model.freedom import Estimate, effect_names
from twinmill.predict.problem import GAINS, Scene
from twinmill.predict.windows import score_of

APART = 4.0  # the same of an effect's parameter: what sets a robot apart


@dataclass(frozen=True)
class RobotOff:
    """One robot that differs.

    Attributes:
        robot_id: which.
        effect: what differs: an effect, one of the gains theta_a1 and theta_a2, or None if nothing
            of the catalogue explains it.
        parameters: of that effect, for this robot alone.
        score_before, score_after: of this robot, held-out: with the model of all, and with its own.
        p_value: chance of such a difference if there were none, over all robots and effects.
        why: a sentence.
        gains: theta_a1 and theta_a2 beside them.
        scenes: its measurements with its own model.
    """

    robot_id: int
    effect: str | None
    parameters: list[Estimate]
    score_before: float
    score_after: float
    p_value: float
    why: str
    gains: list[Estimate]
    scenes: list[Scene]

    @property
    def label(self) -> str:
        """R03."""
        return f"R{self.robot_id:02d}"

    def to_json(self) -> dict:
        """Fields of the interface."""
        fields = ("robot_id", "effect", "score_before", "score_after", "p_value", "why")
        parameters = [e.to_json() for e in self.parameters]
        return {**{k: getattr(self, k) for k in fields}, "parameters": parameters}


def own_effects(off: Collection[RobotOff]) -> list[str]:
    """Effects that only some robots have: neutral in the model for the others."""
    names = [e.name.split(".")[0] for r in off for e in r.parameters if e.name not in GAINS]
    return list(dict.fromkeys(names))


def own_values(
    alike: list[Scene], solution: Solution, off: Collection[RobotOff]
) -> dict[int, list[Estimate]]:
    """By robot, what [robots.Rnn] states: its gains, and the effects that only it has.

    Args:
        alike: measurements of the robots that are alike.
        solution: of their fit.
        off: the others.
    """
    values: dict[int, dict[str, Estimate]] = {}
    for scene, own in zip(alike, solution.own, strict=True):
        gains = {n: e for n, e in own.items() if n in GAINS}
        if gains:
            values.setdefault(robot_of(scene), {}).update(gains)
    for robot in off:
        own = {e.name: e for e in [*robot.gains, *robot.parameters]}
        values.setdefault(robot.robot_id, {}).update(own)
    return {robot_id: list(own.values()) for robot_id, own in values.items()}


def sentence(off: RobotOff) -> str:
    """One line on a robot."""
    if off.effect is None:
        return f"{off.label} differs, and no effect of the catalogue explains how."
    values = ", ".join(f"{e.name} {e.value:.3g}{_unit(e)}" for e in off.parameters)
    return f"{off.label} differs: {values}."


def _unit(estimate: Estimate) -> str:
    return "" if estimate.unit == "1" else f" {estimate.unit}"


def judge(
    state: State,
    odd: list[Scene],
    say: Callable[[str], None],
    barred: Collection[str] = (),
) -> list[RobotOff]:
    """Says of each odd robot what is different, with the model of the others held.

    Args:
        state: of the robots that are alike, with all effects that were found for them.
        odd: measurements of the others.
        say: told in words what is being done.
        barred: effects that are not to be thought of.
    """
    off = []
    for robot_id in sorted({robot_of(s) for s in odd}):
        say(f"robot {robot_id} differs: looking for what it is")
        own = [i for i, s in enumerate(odd) if robot_of(s) == robot_id]
        found = _judge_robot(state, [odd[i] for i in own], barred)
        if found:
            off.append(found)
    return off


def _judge_robot(state: State, odd: list[Scene], barred: Collection[str]) -> RobotOff | None:
    floors = [np.median(state.floors, axis=0)] * len(odd)
    before = attempt(State(_plain(state, odd), [], floors, _held(state)), ())
    alone = replace(
        State([replace(s, gains_free=True) for s in before.scenes], [], floors), held=_held(state)
    )
    solve(alone.scenes, [])
    every, robot_id = [*state.scenes, *alone.scenes], robot_of(odd[0])
    count = len({robot_of(s) for s in every})
    others = score_of([rms_of(s) for s in state.scenes], state.floors)
    done, final = search(alone, lambda _: None, barred)
    names = effect_names(final.model)[len(state.model.effects) :]
    own = solve(final.scenes, final.free).estimates
    names = [n for n in names if _sets_apart(state, own, n)]
    if names:
        first = next(r.accepted for r in done.rounds if r.accepted)
        log_p = np.log(count * len(done.rounds[0].screening.found)) - first.evidence
        return _off(final, before, names, float(np.exp(min(0.0, log_p))), others)
    away = {n: gains_apart(every, n)[robot_id] for n in GAINS}
    if gains := [n for n in GAINS if away[n] > ODD]:
        p_value = min(1.0, 2 * len(GAINS) * count * norm.sf(max(away.values())))
        return _off(alone, before, gains, float(p_value), others)
    z = outlying(every, [*state.floors, *floors])[robot_id]
    if z < ODD:
        return None
    return _off(alone, before, [], float(min(1.0, count * t.sf(z, count - 1))), others)


def _plain(state: State, odd: list[Scene]) -> list[Scene]:
    """Measurements with model and noise of the others, and gains as the model file has them."""
    loud = [s.noise.loudness(s.grid.period_s) for s in state.scenes]
    usual = state.scenes[int(np.argsort(loud)[len(loud) // 2])].noise
    plain = [replace(s.with_model(state.model), gains_free=False) for s in odd]
    for scene in plain:
        scene.noise = usual
        for name in GAINS:
            if name not in scene.stated:
                scene.model.set(name, 1.0)
    return plain


def _sets_apart(state: State, own: list[Estimate], instance: str) -> bool:
    """Whether an effect's values are far from those that each of the other robots would take."""
    mine = {e.name.split(".", 1)[1]: e for e in own if e.name.startswith(f"{instance}.")}
    effect = instance.split("#")[0]
    theirs: dict[str, list[float]] = {name: [] for name in mine}
    for robot_id in sorted({robot_of(s) for s in state.scenes}):
        alone = replace(state, scenes=[s for s in state.scenes if robot_of(s) == robot_id])
        alone = replace(alone, base=[], held=_held(state))
        scenes, fresh = grown(alone, (effect,))
        for e in solve(scenes, alone.free + fresh, rounds=ROUNDS, precision=PRECISION).estimates:
            theirs[e.name.split(".", 1)[1]].append(e.value)
    for name, estimate in mine.items():
        middle, scale = middle_and_scale(theirs[name])
        if abs(estimate.value - middle) > APART * max(scale, estimate.std):
            return True
    return False


def _held(state: State) -> frozenset[str]:
    return frozenset(f.name for f in state.free)


def _off(final: State, before: Trial, names: list[str], p_value: float, others: float) -> RobotOff:
    solution = solve(final.scenes, final.free)
    after = attempt(final, ())
    gains = [e for n, e in solution.own[0].items() if n in GAINS]
    parameters = [e for e in [*solution.estimates, *gains] if e.name.split(".")[0] in names]
    told = f"its errors are {before.score:.2f} times the floor with the model of all, those of the "
    told += f"others {others:.2f}; "
    told += (
        f"{' and '.join(names)} of its own makes them {after.score:.2f}"
        if names
        else "no effect of the catalogue explains it: pushes and bumps by others would look so"
    )
    return RobotOff(
        robot_of(final.scenes[0]),
        " + ".join(names) or None,
        parameters,
        before.score,
        after.score,
        p_value,
        told,
        gains,
        final.scenes,
    )
