# SPDX-License-Identifier: Apache-2.0
"""The motion that parts what a diagnosis could not tell, among random ones within limits.

Each motion is run in MuJoCo. What an effect would change there, over the noise of the log, is as
likely as the evidence says if that effect is missing, and if another one is, each beside the base's
inexact numbers: the difference is the log odds that the motion is expected to give. The motion
after which the fewest questions are expected to be open is the answer.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from twinmill.data.lcm_log import LogError
from twinmill.inference.evidence import log_evidence
from twinmill.inference.settings import PRIORS
from twinmill.joints import dependences
from twinmill.joints.always import Always
from twinmill.joints.diagnose import JointDiagnosis, Logs, diagnose_joints
from twinmill.joints.excitation import Limits, Motion, motion
from twinmill.joints.log import JointLog
from twinmill.joints.mjcf import Mjcf
from twinmill.joints.plant import JointModel, Plant, Steps
from twinmill.joints.problem import begun
from twinmill.joints.series import series_of
from twinmill.model.parameters import newest_instance

TRIED = 40  # random motions
PERIOD_S = 0.01  # of a script's commands: what most controllers keep
NOISE = 1.4826  # standard deviations in a median absolute deviation of a normal variate
NOTHING = ""  # instead of the other effect's name

Pair = tuple[str, str]


@dataclass(frozen=True)
class Excitation:
    """A motion for a robot.

    Attributes:
        diagnosis: that left the questions.
        log: stamps, commands, and the positions that the model takes on them.
        odds: expected log odds by pair of names, the second empty for nothing at all.
        before: the same of the logs so far, by the same measure.
        tried, kept: motions that were run, and those within limits.
    """

    diagnosis: JointDiagnosis
    log: JointLog
    odds: Mapping[Pair, float]
    before: Mapping[Pair, float]
    tried: int
    kept: int

    @property
    def mjcf(self) -> Mjcf:
        """The model that was run."""
        return self.diagnosis.mjcf

    def to_json(self) -> dict[str, Any]:
        """Fields of `twinmill next --json` of an MJCF."""
        return {
            "questions": [
                {
                    "effect": a,
                    "instead": b or None,
                    "probability": sure(odds),
                    "probability_in_logs": sure(self.before[a, b]),
                }
                for (a, b), odds in self.odds.items()
            ],
            "findings": self.diagnosis.to_json()["findings"],
            "duration_s": float(np.ptp(self.log.t_s)),
            "tried": self.tried,
            "within_limits": self.kept,
        }

    def text(self) -> str:
        """CSV that is a log of joints, too: what is commanded, and where the joints are to be."""
        names = [*(f"ctrl.{a}" for a in self.mjcf.actuators),
                 *(f"qpos.{j}" for j in self.mjcf.joints)]  # fmt: skip
        rows = np.column_stack([self.log.t_s, self.log.ctrl, self.log.qpos])
        lines = (",".join(f"{value:.6g}" for value in row) for row in rows)
        return "\n".join([",".join(["t_s", *names]), *lines, ""])


def sure(odds: float) -> float:
    """Probability of the right one of two names, at even odds before."""
    return float(1 / (1 + np.exp(-odds)))


def next_joints(
    logs: Logs,
    model: Mjcf | Path | str,
    *,
    own: Logs | None = None,
    duration_s: float = 30.0,
    times_speed: float = 1.0,
    progress: Callable[[str], None] = lambda _: None,
) -> Excitation:
    """Designs the run that best parts what logs of a machine leave open.

    Args:
        logs: one or several, as of `diagnose_joints`.
        model: opened, or its path.
        own: as of `diagnose_joints`.
        duration_s: of the run.
        times_speed: highest speed of each joint, over that in the logs.
        progress: told in words what is being done.

    Raises:
        LogError: a log does not fit, nothing is left open, or no motion keeps the limits.
        ModelError: the model cannot be loaded, or is of a kind that is not judged.
    """
    found = diagnose_joints(logs, model, progress, own=own)
    plant, mjcf = found.problem.plant, found.mjcf
    asked = _Asked.of(found)
    before = asked.odds(plant, asked.likely)
    pairs = asked.likely or [pair for pair, odds in asked.odds(plant, asked.unseen).items()
                             if sure(odds) < PRIORS.sure]  # fmt: skip
    if not pairs:
        raise LogError(
            f"{plant.series.log.name}: leaves no question open: each effect of the catalogue would "
            "have shown in it, and none is likely that is not sure."
        )
    before = before or asked.odds(plant, pairs)
    limits = Limits.of(mjcf, plant.series, times_speed)
    stock, t_s = mujoco.MjModel.from_xml_path(str(mjcf.path)), np.arange(0, duration_s, PERIOD_S)
    begin, runs = np.median(plant.series.log.qpos, axis=0), list[Motion]()
    best: tuple[float, Motion, Mapping[Pair, float]] | None = None
    begin_s = time.monotonic()
    for seed in range(TRIED):
        left_s = (time.monotonic() - begin_s) / max(seed, 1) * (TRIED - seed)
        remaining = f", {left_s:.0f} s left" if seed else ""
        progress(f"motion {seed + 1} of {TRIED}{remaining}")
        runs.append(one := motion(mjcf, stock, limits, begin, t_s=t_s, seed=seed))
        if not one.exceeds:
            odds = asked.odds(Plant.of(mjcf, series_of(one.log)), pairs)
            left = sum(1 - sure(o) for o in odds.values())
            if best is None or left < best[0]:
                best = left, one, odds
    if best is None:
        raise LogError(_refusal(runs, duration_s))
    (a, b), most = max(best[2].items(), key=lambda item: item[1])
    if sure(most) < PRIORS.sure:
        other = f"'{b}'" if b else "nothing"
        raise LogError(
            f"next: none of {TRIED} motions within the limits is expected to tell '{a}' from "
            f"{other} (at most {100 * sure(most):.0f} %), or others in "
            "question better: while the joints move they change the same, or too little."
        )
    kept = sum(not run.exceeds for run in runs)
    return Excitation(found, best[1].log, best[2], before, TRIED, kept)


def _refusal(runs: Sequence[Motion], duration_s: float) -> str:
    """Why there is no motion: that which most of them exceed first."""
    firsts = [run.exceeds for run in runs]
    kinds = [" ".join(text.split()[:4]) for text in firsts]
    usual = firsts[kinds.index(max(kinds, key=kinds.count))]
    return (
        f"next: none of {len(runs)} motions of {duration_s:g} s keeps the limits; in most of them "
        f"{usual}. Log a livelier run, or write the real limits into the model (range, ctrlrange, "
        "forcerange): what it does not limit may not exceed what the logs reached."
    )


@dataclass(frozen=True)
class _Asked:
    """Questions of a diagnosis, with what has to be the same in each motion.

    Attributes:
        always: what the model lacks in its own log, too; None where that is not known.
        values: numbers of each effect: as fitted by itself, or else of usual size.
        noise: (J,) standard deviation of a step's error.
        likely: pairs of names of which one is missing.
        unseen: each effect against nothing.
    """

    always: Always | None
    values: Mapping[str, Mapping[str, float]]
    noise: np.ndarray
    likely: list[Pair]
    unseen: list[Pair]

    @classmethod
    def of(cls, found: JointDiagnosis) -> "_Asked":
        """Groups, or else names that are neither likely nor unlikely."""
        answer, problem = found.answer, found.problem
        groups = [f.group for f in answer.findings if f.certainty == "group"]
        likely = [(a, b) for group in groups for a in group for b in group if a != b]
        open_to = [n for n, p in answer.effects.items() if PRIORS.member <= p < PRIORS.sure]
        values = {}
        for name, effect in problem.effects.items():
            values[name] = {
                n.key: n.value * (PRIORS.size if n.role == "size" else 1.0)
                for n in effect.parameters
            }
            own = found.fitted.get((name,))
            if own is not None:
                h = own.hypothesis
                values[name] = {key: h.model.get(f"{h.instance(name)}.{key}")
                                for key in values[name]}  # fmt: skip
        best = min(found.fitted.values(), key=lambda e: -e.alone).hypothesis.errors
        errors = np.asarray(problem.base.errors if best is None else best)
        slides = problem.plant.usual.slides > 0
        noise = np.array([np.median(np.abs(e[s])) if s.any() else 0.0
                          for e, s in zip(errors.T, slides.T, strict=True)])  # fmt: skip
        return cls(
            found.always,
            values,
            np.maximum(NOISE * noise, 1e-12),
            likely or [(n, NOTHING) for n in open_to if n in problem.effects],
            [(name, NOTHING) for name in problem.effects],
        )

    def odds(self, plant: Plant, pairs: Sequence[Pair]) -> dict[Pair, float]:
        """Log odds that are expected between two names from a run."""
        if not pairs:
            return {}
        _, model, prior = begun(plant, self.always)
        steps = Steps(plant)
        base = self._base(steps, model, prior)
        names = {name for pair in pairs for name in pair if name}
        change = {name: self._change(steps, model, name) for name in names}
        spread = {name: np.concatenate([base, self._around(plant, c)])
                  for name, c in change.items()} | {NOTHING: base}  # fmt: skip
        found = {}
        for a, b in pairs:
            y = self._white(change[a][None])[0]
            found[a, b] = log_evidence(y, spread[a]) - log_evidence(y, spread[b])
        return found

    def _around(self, plant: Plant, change: np.ndarray) -> np.ndarray:
        """(K, R) an effect of unknown size, with what its formula may be off by."""
        forms = [PRIORS.form * self._white(f) for f in dependences.forms_of(plant, change)]
        return np.concatenate([self._white(change[None]), *forms])

    def _base(self, steps: Steps, model: JointModel, prior: Any) -> np.ndarray:
        """(K, R) what the base's numbers and equations may be off by."""
        std = np.sqrt(np.diag(prior.cov))[: len(prior.names)]
        zero = steps.errors(model)[0]
        moved = [
            steps.errors(model, [name], [[mean + s]])[0] - zero
            for name, mean, s in zip(prior.names, prior.mean, std, strict=False)
        ]
        return self._white(np.concatenate([np.array(moved), prior.columns]))

    def _change(self, steps: Steps, model: JointModel, name: str) -> np.ndarray:
        """(W, J) of the errors by an effect at its numbers."""
        changed = model.copy()
        changed.add_effect(name)
        instance = newest_instance(changed, name)  # type: ignore[arg-type]
        for key, value in self.values[name].items():
            changed.set(f"{instance}.{key}", value)
        return np.asarray(steps.errors(changed)[0] - steps.errors(model)[0])

    def _white(self, columns: np.ndarray) -> np.ndarray:
        """(K, R) of (K, W, J), over the noise."""
        return np.asarray(columns / self.noise).reshape(len(columns), -1)
