# SPDX-License-Identifier: Apache-2.0
"""The model of several robots with what all lack, and what is one robot's own.

All numbers are fitted to the logs of all robots together: what all lack first, then what each robot
has of its own, beside it.
"""

from collections.abc import Callable
from pathlib import Path

import tomlkit

from twinmill.diagnosis.better import Better
from twinmill.diagnosis.fleet import REFIT, Differs, Fleet
from twinmill.fitting.add import OWN_GAINS, add_to_model
from twinmill.fitting.compare import comparison
from twinmill.fitting.fit import Choice, fit_model
from twinmill.fitting.opening import open_measurements
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import LAG, LAG_EFFECT, ParameterEstimate


def better_of_fleet(
    found: Fleet,
    model_file: ModelFile,
    path: Path,
    *,
    command: str,
    progress: Callable[[str], None] = lambda _: None,
) -> Better:
    """The likeliest model, to be written.

    Args:
        found: in logs of several robots.
        model_file: the model that was judged.
        path: of the new file.
        command: recorded in it.
        progress: told in words what is being done.

    Raises:
        ModelError: what was found cannot be added.
    """
    runs, child, estimates = found.measurements, model_file, []
    own = [(name, one.robot_id) for one in found.added_alone for name in _names(one)]
    if found.answer.verdict == "refit_enough" or not (found.added or own):
        progress("fitting the base")
        fitted = fit_model(runs, child, path, command, choice=Choice())
        child, estimates = fitted.child, fitted.parameters
    for name, robot in [*((name, None) for name in found.added), *own]:
        progress(f"adding {name}" if robot is None else f"adding {name} of R{robot:02d}")
        more = add_to_model(name, runs, child, path=path, command=command, robot_id=robot)
        child, estimates = more.child, _renewed(estimates, more.parameters)
    child = _of_one_step(child, model_file, found.before.score)
    after = comparison(child, open_measurements(runs, child))
    added = (*found.added, *(one.name for one in found.added_alone if one.is_effect))
    return Better(child, tuple(dict.fromkeys(added)), found.before, after, found, estimates)


def _names(one: Differs) -> list[str]:
    """Names by which what is a robot's own is added."""
    if one.name != REFIT:
        return [one.name]
    lag = [LAG_EFFECT] if LAG in one.numbers else []
    return lag + ([OWN_GAINS] if {*one.numbers} - {LAG} else [])


def _renewed(old: list[ParameterEstimate], new: list[ParameterEstimate]) -> list[ParameterEstimate]:
    names = {e.name for e in new}
    return [*(e for e in old if e.name not in names), *new]


def _of_one_step(child: ModelFile, parent: ModelFile, score: float) -> ModelFile:
    """The file with the given model, and its score, as what it comes from; no other was written."""
    document = tomlkit.parse(child.text)
    document["parent"] = parent.hash
    document["fit"]["score_before"] = float(f"{score:.6g}")
    return ModelFile.of(child.path, tomlkit.dumps(document))
