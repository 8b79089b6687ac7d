# SPDX-License-Identifier: Apache-2.0
"""Adds an effect to a model: fitted together with the base, judged on data it was not fitted to."""

from dataclasses import dataclass
from pathlib import Path

from twinmill.data.measurement import Measurement
from twinmill.fitting.compare import Comparison, comparison, open_scenes
from twinmill.fitting.fit import common_clock, refit, share_noise
from twinmill.fitting.heldout import HeldOut, held_out
from twinmill.fitting.solve import excited, solve
from twinmill.model.freedom import Estimate, base_quantities, effect_names, effect_quantities
from twinmill.model.model_file import Fitted, ModelFile, write_child


@dataclass(frozen=True)
class AddResult:
    """What adding an effect did.

    Attributes:
        before: comparison of the model as given; after: with the effect, all refitted.
        heldout_before: the model as given.
        heldout_refit: its quantities refitted without the effect.
        heldout_after: refitted with it.
    """

    effect: str
    before: Comparison
    after: Comparison
    parameters: list[Estimate]
    heldout_before: HeldOut
    heldout_refit: HeldOut
    heldout_after: HeldOut
    path: Path

    def to_json(self) -> dict:
        """The interface's object."""
        return {
            "effect": self.effect,
            "model": str(self.path),
            "score_before": self.before.score,
            "score_after": self.after.score,
            "heldout_before": self.heldout_before.score,
            "heldout_refit": self.heldout_refit.score,
            "heldout_after": self.heldout_after.score,
            "parameters": [e.to_json() for e in self.parameters],
            "heldout_errors_before": self.heldout_before.rows(),
            "heldout_errors_after": self.heldout_after.rows(),
        }


def add(
    effect: str,
    measurements: list[Measurement],
    model_file: ModelFile,
    out: Path,
    command: str,
    texts: dict[str, str] | None = None,
) -> AddResult:
    """Adds an effect and writes the new model.

    Args:
        effect: its name.
        measurements: what it is fitted to.
        model_file: the model that lacks it.
        out: the new model file.
        command: recorded in it.
        texts: the effect's formula and the like, by name.

    Raises:
        ValueError: no such effect, it is made for another drive, or a text makes no sense.
        ModelError: the new file cannot be written.
    """
    richer = model_file.model.copy()
    richer.add_effect(effect, texts or {})
    name = effect_names(richer)[-1]
    scenes = open_scenes(measurements, model_file)
    known = effect_quantities(model_file.model)
    logs = {m.log_name: m.log_sha256 for m in measurements}
    told = model_file.told_by_others(logs.values())
    old = excited(scenes, base_quantities(model_file.model, told), known) + known
    fresh = [f for f in effect_quantities(richer, fresh=name) if f.name.startswith(f"{name}.")]
    free = old + fresh
    grown = [scene.with_model(richer) for scene in scenes]
    solution = refit(grown, free)
    share_noise(grown, scenes)
    before, after = comparison(model_file, scenes), comparison(model_file, grown)
    floors = [r.floor.rms for r in after.robots]
    refitted = [scene.with_model(model_file.model) for scene in scenes]
    solve(refitted, old)
    held = [
        held_out(scenes, [], floors),
        held_out(refitted, old, floors),
        held_out(grown, free, floors),
    ]
    for estimate in solution.estimates:
        richer.set(estimate.name, estimate.value)
    write_child(
        model_file,
        Fitted(
            richer,
            solution.estimates,
            logs,
            before.score,
            after.score,
            grown[0].noise,
            common_clock(solution),
            bool(told),
        ),
        out,
        command,
    )
    return AddResult(name, before, after, solution.estimates, *held, Path(out))
