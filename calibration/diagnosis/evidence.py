# SPDX-License-Identifier: Apache-2.0
"""Judges effects on drives that they were not fitted to.

The fall of the held-out chi2 is evidence for an effect (split likelihood ratio: Wasserman, Ramdas
and Balakrishnan 2020), divided by what the errors scatter more than the noise model says.
"""

from dataclasses import dataclass, replace

import numpy as np
import twinmill_native as native
from twinmill.calibration.folds import halves, held_errors, step_mask
from twinmill.calibration.freedom import Free, effect_names, effect_quantities
from twinmill.calibration.problem import Scene
from twinmill.calibration.solve import HUBER_SIGMA, Estimate, solve
from twinmill.calibration.windows import rms

ROUNDS, REFINED = 8, 3  # of a trial's fit, and of the halves that start from it


@dataclass(frozen=True)
class State:
    """Where a diagnosis stands.

    Attributes:
        scenes: measurements with the model so far.
        base: free base quantities.
        floors: (H, 3) per scene.
    """

    scenes: list[Scene]
    base: list[Free]
    floors: list[np.ndarray]

    @property
    def model(self) -> native.Model:
        """The model so far."""
        return self.scenes[0].model

    @property
    def free(self) -> list[Free]:
        """Everything that is fitted together; widths of the prior about the values so far."""
        base = [replace(f, begin=self.model.get(f.name)) for f in self.base]
        return base + effect_quantities(self.model)


@dataclass(frozen=True)
class Trial:
    """A model with some effects more (or fewer), fitted on one half and judged on the other.

    Attributes:
        effects: what was added.
        chi2: held-out robust chi2, both ways.
        rms: (H, 3) held-out errors per scene.
        score: of these over the state's floors.
        scenes: with the model fitted to all.
        estimates: of the added effects' parameters, fitted to all.
    """

    effects: tuple[str, ...]
    chi2: float
    rms: list[np.ndarray]
    score: float
    scenes: list[Scene]
    estimates: list[Estimate]


def attempt(state: State, effects: tuple[str, ...]) -> Trial:
    """Fits the state's model with `effects` added.

    Args:
        state: the model so far.
        effects: names.
    """
    model = state.model.copy()
    fresh: list[Free] = []
    for effect in effects:
        model.add_effect(effect)
        name = effect_names(model)[-1]
        fresh += [f for f in effect_quantities(model, name) if f.name.startswith(f"{name}.")]
    scenes = [s.with_model(model) for s in state.scenes]
    solution = solve(scenes, state.free + fresh, rounds=ROUNDS)
    again = [replace(f, begin=scenes[0].model.get(f.name)) for f in state.free + fresh]
    chi2, held = _cross(scenes, again)
    names = {f.name for f in fresh}
    estimates = [e for e in solution.estimates if e.name in names]
    return Trial(effects, chi2, held, over(held, state.floors), scenes, estimates)


def over(errors: list[np.ndarray], floors: list[np.ndarray]) -> float:
    """Score of (H, 3) RMS errors over floors, both per scene."""
    return float(
        np.sqrt(np.mean([np.nanmean((e / f) ** 2) for e, f in zip(errors, floors, strict=True)]))
    )


def without(state: State, index: int) -> Trial:
    """The state's model with one of its effects removed, the rest refitted."""
    model = state.model.copy()
    model.remove_effect(index)
    scenes = [s.with_model(model) for s in state.scenes]
    reduced = State(scenes, state.base, state.floors)
    return attempt(reduced, ())


def _cross(scenes: list[Scene], free: list[Free]) -> tuple[float, list[np.ndarray]]:
    """Held-out chi2 and (H, 3) RMS errors per scene, both ways."""
    halves_of = [halves(s) for s in scenes]
    chi2, errors = 0.0, [[] for _ in scenes]
    for which in (0, 1):
        tried = [replace(s, model=s.model.copy()) for s in scenes]
        own, other = (
            [step_mask(s, h, w) for s, h in zip(tried, halves_of, strict=True)]
            for w in (which, 1 - which)
        )
        solve(tried, free, own, REFINED)
        chi2 += _chi2(tried, other)
        for i, (scene, half) in enumerate(zip(tried, halves_of, strict=True)):
            errors[i].append(held_errors(scene, half, 1 - which))
    return chi2, [rms(np.concatenate(e)) for e in errors]


def _chi2(scenes: list[Scene], masks: list[np.ndarray]) -> float:
    """Robust chi2 of the masked steps (Huber 1964)."""
    total = 0.0
    for scene, mask in zip(scenes, masks, strict=True):
        z = np.abs(scene.white_errors()[mask])
        robust = np.where(z < HUBER_SIGMA, z**2, HUBER_SIGMA * (2 * z - HUBER_SIGMA))
        total += float(robust.sum())
    return total
