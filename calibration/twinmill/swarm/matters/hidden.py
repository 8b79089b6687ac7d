# SPDX-License-Identifier: Apache-2.0
"""Effects that a log does not exclude, and how strong each may be without having shown in it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.diagnosis.result import Diagnosis
from twinmill.model.parameters import MOTION_STAGES, catalogue_of

MOST = 3.0  # times the usual strength: more is not thought of, as in a diagnosis
OF_A_LOG = "observe"  # stage of what says nothing of the robot


@dataclass(frozen=True)
class Hidden:
    """One effect.

    Attributes:
        times: how many times its usual strength it may have.
        why: in words.
    """

    effect: str
    times: float
    why: str

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "Hidden":
        """The inverse of to_json."""
        return cls(**data)

    def to_json(self) -> dict[str, Any]:
        """Its fields."""
        return vars(self)


def hidden_effects(diagnosis: Diagnosis) -> list[Hidden]:
    """All effects of the catalogue that the model lacks.

    A diagnosis looks at the trace of each in the log's errors, what the free quantities could
    imitate left out. One so strong that its trace would lower the squared error, in units of its
    scatter, by less than what the diagnosis takes for evidence would not have been named.
    """
    search = diagnosis.search
    traces = {s.name: float((s.columns.sum(axis=1) ** 2).sum()) for s in search.rounds[-1].screened}
    found = []
    for name in _lacking(diagnosis.model):
        stage = catalogue_of(diagnosis.model)[name]["stage"]
        if name not in traces:
            why = (
                "this log does not show it"
                if stage in MOTION_STAGES
                else "the motion of one robot does not show it"
            )
            times = MOST if stage in MOTION_STAGES else 1.0
        else:
            times = float(min(MOST, np.sqrt(search.settings.evidence / max(traces[name], 1e-12))))
            why = (
                f"more than {times:.2g} times its usual strength would have shown in this log"
                if times < MOST
                else f"{MOST:g} times its usual strength would not have shown in this log"
            )
        found.append(Hidden(name, times, why))
    return found


def unseen_effects(model: native.Model) -> list[Hidden]:
    """Effects without a log: nothing is excluded, and each has its usual strength."""
    return [Hidden(name, 1.0, "no log excludes it") for name in _lacking(model)]


def _lacking(model: native.Model) -> list[str]:
    return [
        name
        for name, card in catalogue_of(model).items()
        if name not in model.effects and card["stage"] != OF_A_LOG and not card["texts"]
    ]
