# SPDX-License-Identifier: Apache-2.0
"""Checks of a model's formulas over logs: states that grow, and formulas without a value."""

from collections.abc import Sequence

import numpy as np
import twinmill_native as native

from twinmill.model.model_file import ModelError
from twinmill.model.parameters import (
    catalogue_name,
    effect_names,
    instance_of,
    numbers_of,
    phases,
    words_of,
)
from twinmill.predict.datasets import ErrorDataset, Trajectory, errors_of

EQUATION = "equation"
GROWN = 1e9  # errors, in what is usual of them: nothing that drives is so far off
FAR = 1e4  # m or rad, within the longest prediction: nothing drives or turns so fast
NOTHING = 1e-9  # of errors: what is rounded off
# Of n ln S^2: of 24 moments of a period, of which the best is taken, by chance one in 100 has more.
SHOWN = 2 * np.log(24) + 6.6


def check_states(data: ErrorDataset, model: native.Model) -> None:
    """Raises ModelError, naming the state, where one of a formula grows beyond all bounds."""
    remembering = {name: t for name, t in _equations(model).items() if t.get("state_rate")}
    if not remembering:
        return
    if finite(data, model):
        return
    for name, texts in remembering.items():
        second = texts.get("second_rate")
        states = "states s and r grow" if second else "state s grows"
        rates = f"ds/dt = {texts['state_rate']}" + (f", dr/dt = {second}" if second else "")
        raise ModelError(
            f"{name}: its {states} beyond all bounds in these logs ({rates}); write rates that "
            "bring it back, such as (vx - s)/0.5."
        )


def finite(data: ErrorDataset, model: native.Model) -> bool:
    """True if a model predicts something, and nothing beyond all bounds."""
    with np.errstate(all="ignore"):
        rows = errors_of(data, model)
        far = 0.0
        if isinstance(data, Trajectory):  # errors of headings are taken the short way round
            poses = data.windows.predicted(data.measurement, model)
            far = np.abs(np.nan_to_num(poses)).max(initial=0.0)
    return bool(np.isfinite(rows).all() and np.abs(rows).max(initial=0.0) < GROWN and far < FAR)


def idle(data: Sequence[ErrorDataset], models: Sequence[native.Model]) -> list[str]:
    """A sentence for each formula that changes no prediction, though its numbers are not zero.

    One that recurs may just not be there within a log: of that `unseen` tells.

    Args:
        data: that can be judged.
        models: one for each.
    """
    found = []
    for name, texts in _equations(models[0]).items() if data else ():
        named = [p for p in numbers_of(texts) if p in words_of(texts)]
        if named and not any(m.get(f"{name}.{p}") for m in models for p in named):
            continue
        if any(instance_of(p.name) == name for p in phases(models[0])):
            continue
        if not any(_acts(d, m, name) for d, m in zip(data, models, strict=True)):
            found.append(
                f"{name}: formula '{texts['formula']}' changes no prediction of these logs, since "
                "it has no finite value in them, or is always zero."
            )
    return found


def unseen(data: ErrorDataset, model: native.Model) -> list[str]:
    """Names of the formulas that recur, and that a log does not show.

    At the best moment of its period it must bring more than the best of so many would by chance.
    """
    found = []
    own = [instance_of(p.name) for p in phases(model)] if isinstance(data, Trajectory) else []
    for name in dict.fromkeys(own):
        without, with_it = (np.sum(errors_of(data, m) ** 2) for m in (_without(model, name), model))
        if data.n_eff.sum() * np.log(without / with_it) < SHOWN:
            found.append(name)
    return found


def said_of_unseen(label: str, names: Sequence[str]) -> list[str]:
    """A sentence for each of these formulas that a log does not show."""
    return [
        f"{label}: does not show {name}, which recurs in time: at no moment of its period does it "
        "predict this log better than without; the robot may lack it now."
        for name in names
    ]


def _without(model: native.Model, name: str) -> native.Model:
    less = model.copy()
    less.remove_effect(effect_names(model).index(name))
    return less


def _acts(data: ErrorDataset, model: native.Model, name: str) -> bool:
    less = _without(model, name)
    return not np.allclose(errors_of(data, model), errors_of(data, less), rtol=0, atol=NOTHING)


def _equations(model: native.Model) -> dict[str, dict[str, str]]:
    """Texts of a model's formulas by name."""
    pairs = zip(effect_names(model), model.texts, strict=True)
    return {name: texts for name, texts in pairs if catalogue_name(name) == EQUATION}
