# SPDX-License-Identifier: Apache-2.0
"""Adds an effect of the camera to a model: fitted to bits, judged on those it was not fitted to."""

from dataclasses import dataclass
from pathlib import Path

from twinmill.data.measurement import Measurement
from twinmill.diagnosis.detections.fit import STAGES
from twinmill.diagnosis.detections.search import attempt
from twinmill.fitting.opening import open_measurements
from twinmill.model.model_file import Fitted, ModelFile, write_child
from twinmill.model.parameters import ParameterEstimate, catalogue
from twinmill.predict.detection_errors import DetectionComparison, compare_detections
from twinmill.predict.detections import all_detections


@dataclass(frozen=True)
class DetectionAddition:
    """What adding an effect did: bits before and after, and scores on frames not fitted to."""

    effect: str
    before: DetectionComparison
    after: DetectionComparison
    heldout_before: float
    heldout_after: float
    parameters: list[ParameterEstimate]
    path: Path

    def to_json(self) -> dict:
        """The interface's object; scores are those of bits."""
        return {
            "effect": self.effect,
            "model": str(self.path),
            "score_before": self.before.score,
            "score_after": self.after.score,
            "heldout_before": self.heldout_before,
            "heldout_after": self.heldout_after,
            "parameters": [e.to_json() for e in self.parameters],
            "bits": self.after.to_json(),
        }


def is_of_camera(effect: str) -> bool:
    """Whether an effect of the catalogue acts on the camera's bit and not on motion."""
    return catalogue()[effect]["stage"] in STAGES


def add_to_camera(
    effect: str, measurements: list[Measurement], model_file: ModelFile, out: Path, command: str
) -> DetectionAddition:
    """Adds an effect and writes the new model.

    Raises:
        ValueError: the logs hold no bits, or the model has the effect.
        ModelError: the new file cannot be written.
    """
    if effect in model_file.model.effects:
        raise ValueError(
            f"effect '{effect}': {model_file.path.name} has it already; remove its [[effect]]."
        )
    scenes = all_detections([o.scene() for o in open_measurements(measurements, model_file)])
    if not scenes:
        raise ValueError(
            f"effect '{effect}': acts on the camera's bit, and no log has bits of a robot and the "
            "poses of another one beside it; record telemetry and poses of two robots or more."
        )
    before, after = (attempt(scenes, model_file.model, name) for name in (None, effect))
    given, grown = (compare_detections(scenes, m) for m in (model_file.model, after.model))
    logs = {m.log_name: m.log_sha256 for m in measurements}
    fitted = Fitted(after.model, list(after.own), logs, given.score, grown.score)
    write_child(model_file, fitted, out, command)
    return DetectionAddition(
        effect, given, grown, before.score, after.score, list(after.own), Path(out)
    )
