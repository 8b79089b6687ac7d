# SPDX-License-Identifier: Apache-2.0
"""Judges effects on drives that they were not fitted to.

The fall of the held-out chi2 is evidence for an effect (split likelihood ratio: Wasserman, Ramdas
and Balakrishnan 2020), divided by what the errors scatter more than the noise model says.
"""

from dataclasses import dataclass, replace

import numpy as np
import twinmill_native as native

from twinmill.fitting.heldout import HeldOut, held_out
from twinmill.fitting.solve import huber, solve
from twinmill.model.freedom import Estimate, Free, effect_names, effect_quantities
from twinmill.predict.problem import Scene

ROUNDS, PRECISION = 8, 1e-6  # of a trial's fit


@dataclass(frozen=True)
class State:
    """Where a diagnosis stands.

    Attributes:
        scenes: measurements with the model so far.
        base: free base quantities.
        floors: (H, 3) per scene.
        held: names of quantities that are taken as they are.
    """

    scenes: list[Scene]
    base: list[Free]
    floors: list[np.ndarray]
    held: frozenset[str] = frozenset()

    @property
    def model(self) -> native.Model:
        """The model so far: of a robot of which nothing special is stated, if there is one."""
        return min(self.scenes, key=lambda s: len(s.stated)).model

    @property
    def free(self) -> list[Free]:
        """Everything that is fitted together; widths of the prior about the values so far."""
        base = [replace(f, begin=self.model.get(f.name)) for f in self.base]
        return [f for f in base + effect_quantities(self.model) if f.name not in self.held]


@dataclass(frozen=True)
class Trial:
    """A model with some effects more (or fewer), fitted on one half and judged on the other.

    Attributes:
        effects: what was added.
        held: errors of each half, fitted on the other.
        scenes: with the model fitted to all.
        estimates: of the added effects' parameters, fitted to all.
        fitted_chi2: robust chi2 where it is fitted to all.
    """

    effects: tuple[str, ...]
    held: HeldOut
    scenes: list[Scene]
    estimates: list[Estimate]
    fitted_chi2: float

    @property
    def chi2(self) -> float:
        """Held-out robust chi2."""
        return self.held.chi2

    @property
    def score(self) -> float:
        """Held-out errors over the state's floors."""
        return self.held.score


def grown(state: State, effects: tuple[str, ...]) -> tuple[list[Scene], list[Free]]:
    """The state's scenes with `effects` added at neutral values, and what is free of these."""
    model = state.model.copy()
    fresh: list[Free] = []
    for effect in effects:
        model.add_effect(effect)
        name = effect_names(model)[-1]
        fresh += [f for f in effect_quantities(model, name) if f.name.startswith(f"{name}.")]
    return [s.with_model(model) for s in state.scenes], fresh


def attempt(state: State, effects: tuple[str, ...]) -> Trial:
    """Fits the state's model with `effects` added.

    Args:
        state: the model so far.
        effects: names.
    """
    scenes, fresh = grown(state, effects)
    solution = solve(scenes, state.free + fresh, rounds=ROUNDS, precision=PRECISION)
    held = held_out(scenes, state.free + fresh, state.floors)
    names = {f.name for f in fresh}
    estimates = [e for e in solution.estimates if e.name in names]
    fitted_chi2 = sum(huber(s.white_errors()) for s in scenes)
    return Trial(effects, held, scenes, estimates, fitted_chi2)


def fall(less: Trial, more: Trial) -> float:
    """Fall of chi2 by a richer model on drives that it was not fitted to.

    It counts no further than on those it was fitted to: there it gains more, but for chance.
    """
    return min(less.chi2 - more.chi2, less.fitted_chi2 - more.fitted_chi2)


def without(state: State, index: int) -> Trial:
    """The state's model with one of its effects removed, the rest refitted."""
    model = state.model.copy()
    model.remove_effect(index)
    scenes = [s.with_model(model) for s in state.scenes]
    return attempt(replace(state, scenes=scenes), ())
