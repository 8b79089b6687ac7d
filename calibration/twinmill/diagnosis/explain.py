# SPDX-License-Identifier: Apache-2.0
"""Diagnoses, adds what was found, and writes the model that has it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from twinmill.data.measurement import Measurement
from twinmill.diagnosis.diagnose import diagnose
from twinmill.diagnosis.result import Diagnosis
from twinmill.diagnosis.robots import own_effects, own_values
from twinmill.fitting.compare import Comparison, comparison
from twinmill.fitting.fit import common_clock, refit
from twinmill.model.freedom import Estimate
from twinmill.model.model_file import Fitted, ModelFile, write_child


@dataclass(frozen=True)
class Explanation:
    """What was done.

    Attributes:
        diagnosis: with its steps on held-out data.
        after: comparison of the new model.
        parameters: all that was fitted.
        path: of the new model.
    """

    diagnosis: Diagnosis
    after: Comparison
    parameters: list[Estimate]
    path: Path

    def to_json(self) -> dict:
        """The interface's object."""
        return {
            **self.diagnosis.to_json(),
            "steps": steps(self.diagnosis),
            "score_after": self.after.score,
            "parameters": [e.to_json() for e in self.parameters],
            "model": str(self.path),
        }


def steps(diagnosis: Diagnosis) -> list[dict]:
    """The model as given, its base refitted, then each added effect, on held-out data."""
    given = {"effect": None, "score_heldout": diagnosis.before.score}
    refitted, *added = diagnosis.steps
    rest = [{"effect": name, "score_heldout": score} for name, score in added]
    return [given, {"effect": "refit", "score_heldout": refitted[1]}, *rest]


def explain(
    measurements: list[Measurement],
    model_file: ModelFile,
    out: Path,
    command: str,
    say: Callable[[str], None] = lambda _: None,
) -> Explanation:
    """Adds effects until the model is adequate or nothing helps, and writes it.

    Raises:
        ModelError: the new file cannot be written.
    """
    diagnosis = diagnose(measurements, model_file, say)
    state = diagnosis.state
    solution = refit(state.scenes, state.free)
    off = diagnosis.robots_off
    after = comparison(model_file, [*state.scenes, *(s for r in off for s in r.scenes)])
    model = model_file.model.copy()
    for effect in [*diagnosis.found, *own_effects(off)]:
        model.add_effect(effect.split("#")[0])
    estimates = [*solution.estimates, *diagnosis.bit_estimates]
    for estimate in estimates:
        model.set(estimate.name, estimate.value)
    logs = {m.log_name: m.log_sha256 for m in measurements}
    fitted = Fitted(
        model,
        estimates,
        logs,
        diagnosis.before.score,
        after.score,
        state.scenes[0].noise,
        common_clock(solution),
        bool(model_file.told_by_others(logs.values())),
        diagnosis.omnibus.left_over,
        own_values(state.scenes, solution, off),
    )
    write_child(model_file, fitted, out, command)
    return Explanation(diagnosis, after, estimates, Path(out))
