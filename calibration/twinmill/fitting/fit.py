# SPDX-License-Identifier: Apache-2.0
"""Fits the base model, and the effects it has, to measurements."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import twinmill_native as native

from twinmill.data.measurement import Measurement
from twinmill.fitting.compare import Comparison, comparison, open_scenes
from twinmill.fitting.solve import Solution, excited, solve
from twinmill.model.freedom import Estimate, Free, base_quantities, effect_quantities
from twinmill.model.model_file import Fitted, ModelFile, write_child
from twinmill.predict.problem import CLOCK, CLOCK_RATE, Scene

AGREE_SIGMA = 5.0  # clock offsets of several logs that differ by less are one


@dataclass(frozen=True)
class FitResult:
    """What a fit did.

    Attributes:
        before, after: comparisons on the same noise and floor.
        parameters: estimates.
        clock: offset that all logs share, or None.
        path: of the new model.
    """

    before: Comparison
    after: Comparison
    parameters: list[Estimate]
    clock: Estimate | None
    path: Path

    def to_json(self) -> dict:
        """The interface's object."""
        return {
            "model": str(self.path),
            "score_before": self.before.score,
            "score_after": self.after.score,
            "parameters": [e.to_json() for e in self.parameters],
            "time_offset_s": self.clock.value if self.clock else None,
        }


def share_noise(source: list[Scene], scenes: list[Scene]) -> None:
    """Judges scenes by the noise of others of the same measurements."""
    for given, scene in zip(source, scenes, strict=True):
        scene.noise = given.noise


def refit(scenes: list[Scene], free: list[Free]) -> Solution:
    """Fits twice: the second time with the noise that the first fit leaves, if that is less.

    Where much stays unexplained, the errors tell less than they seem to: the prior is then given as
    much more weight as they are too large.
    """
    excess = np.sqrt(max(1.0, solve(scenes, free).chi2))
    for scene in scenes:
        scene.settle_noise()
    return solve(
        scenes,
        [
            replace(f, prior_std=f.prior_std / excess, begin=scenes[0].model.get(f.name))
            for f in free
        ],
    )


def fit(
    measurements: list[Measurement], model_file: ModelFile, out: Path, command: str
) -> FitResult:
    """Fits all free quantities of the model to all measurements and writes the new model.

    Raises:
        ModelError: the new file cannot be written.
    """
    scenes = open_scenes(measurements, model_file)
    known = effect_quantities(model_file.model)
    free = excited(scenes, base_quantities(model_file.model, ()), known) + known
    fitted = [s.with_model(model_file.model) for s in scenes]
    solution = refit(fitted, free)
    share_noise(fitted, scenes)
    before, after = comparison(model_file, scenes), comparison(model_file, fitted)
    clock = common_clock(solution)
    model = fitted_model(model_file, solution.estimates)
    write_child(
        model_file,
        Fitted(
            model,
            solution.estimates,
            {m.log_name: m.log_sha256 for m in measurements},
            before.score,
            after.score,
            fitted[0].noise,
            clock,
        ),
        out,
        command,
    )
    return FitResult(before, after, solution.estimates, clock.get(CLOCK), Path(out))


def fitted_model(model_file: ModelFile, estimates: list[Estimate]) -> native.Model:
    """The file's model with estimates put in."""
    model = model_file.model.copy()
    for estimate in estimates:
        model.set(estimate.name, estimate.value)
    return model


def common_clock(solution: Solution) -> dict[str, Estimate]:
    """Offset and rate that the logs share; empty if they differ, or were known before."""
    if not all(solution.clocks):
        return {}
    common = {}
    for name, least in ((CLOCK, 0.001), (CLOCK_RATE, 5.0)):
        values = np.array([c[name].value for c in solution.clocks])
        stds = np.array([c[name].std for c in solution.clocks])
        weights = 1 / stds**2
        mean = float(np.sum(weights * values) / weights.sum())
        if np.any(np.abs(values - mean) > AGREE_SIGMA * np.hypot(stds, least)):
            return {}
        unit = solution.clocks[0][name].unit
        common[name] = Estimate(name, mean, float(1 / np.sqrt(weights.sum())), unit, False, True)
    return common
