# SPDX-License-Identifier: Apache-2.0
"""Salient effects in a log before its noise is known: a hint for who waits, and no finding.

Effects are screened as in a search, on few predictions, over the errors that the model itself
makes.
"""

from collections.abc import Sequence

from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.diagnosis.diagnose import first_state
from twinmill.diagnosis.screening import candidates, screen
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.trials import REFIT, REFIT_IN_WORDS, fitted
from twinmill.fitting.not_shown import not_shown
from twinmill.fitting.opening import open_roughly
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import WHERE_OR_WHEN, with_role

SEARCHED = (*WHERE_OR_WHEN, "limit")  # roles of what takes long to screen
ABOUT = 0.8  # of the largest gain: what is as likely


def at_first_sight(measurements: Sequence[Measurement | SteadyTable], model_file: ModelFile) -> str:
    """Effects that the first robot seems to lack; empty where nothing stands out."""
    log = next((m for m in measurements if isinstance(m, Measurement)), None)
    opened = open_roughly(log, model_file) if log else None
    if not opened:
        return ""
    state = first_state([opened], model_file, not_shown([opened]))
    names = [n for n in candidates(state) if not any(with_role(n, r) for r in SEARCHED)]
    found = sorted(screen(fitted(state), names=names), key=lambda s: -s.gain)
    likely = [s for s in found if s.gain > max(SETTINGS.evidence, ABOUT * found[0].gain)]
    return " or ".join(REFIT_IN_WORDS if s.name == REFIT else s.name for s in likely[:3])
