# SPDX-License-Identifier: Apache-2.0
"""Models of which no log told the numbers: data sheets.

They are fitted to the judged logs or tables first, since a sheet may be off by more than a linear
model holds for. What all effects are compared beside is the fitted base, known as any base in its
own log. If the sheet would do as well is one question more, with the prior odds of a stale base.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.special import expit

from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.fitting.fit import Choice, fit_model
from twinmill.inference.duties import refined
from twinmill.inference.hypothesis import Fitter
from twinmill.inference.prior import drift
from twinmill.inference.problem import Problem
from twinmill.inference.settings import PRIORS
from twinmill.model.model_file import ModelFile


def is_sheet(model_file: ModelFile) -> bool:
    """True if no log told the numbers of a model, as far as its file says."""
    return not model_file.fit


def fitted_to(
    measurements: Sequence[Measurement | SteadyTable], model_file: ModelFile
) -> ModelFile:
    """The model of a data sheet, fitted; its file is not written.

    Raises:
        LogError: no log can be judged.
    """
    path = Path(model_file.path)
    return fit_model(measurements, model_file, path, "", choice=Choice()).child


def chance_of_stale(p: Problem, sheet: ModelFile, robot_id: int) -> float:
    """Posterior probability that the numbers of a data sheet are off by more than they drift.

    Both hypotheses are linear about the fitted base, and nothing is missing in either.

    Args:
        p: with the fitted base.
        sheet: the file as it was given.
        robot_id: number of the robot, or of any of several.
    """
    model = sheet.model
    if model.drive == "duty":
        model = refined(sheet).model
    robot = model.for_robot(robot_id)
    names = p.prior.names
    ours = np.array([not n.startswith("clock.") for n in names])
    mean, cov = p.prior.mean.copy(), p.prior.cov.copy()
    at = np.flatnonzero(ours)
    mean[at] = [robot.get(names[k]) for k in at]
    cov[at], cov[:, at] = 0.0, 0.0
    cov[np.ix_(at, at)] = drift([names[k] for k in at], mean[at])
    fitter = Fitter(p.steps, p.noise, p.prior.columns)
    as_given = replace(p.base, mean=mean, cov=cov).linear(fitter).log_evidence
    odds = np.log(PRIORS.stale / (1 - PRIORS.stale)) + p.base.linear(fitter).log_evidence - as_given
    return float(expit(odds))
