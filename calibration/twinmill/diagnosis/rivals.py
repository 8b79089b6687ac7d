# SPDX-License-Identifier: Apache-2.0
"""Effects that a formula without a name outdoes: other physics stands behind them.

What is not in the catalogue is taken in part by the effect that is most like it, surely and with a
wrong name. Then a formula of the library takes more on left-out parts than the effect does, each
with one free factor beside all else that was found.
"""

from collections.abc import Sequence

import numpy as np

from twinmill.diagnosis.library import Term
from twinmill.diagnosis.rest import Formulas, formulas_of
from twinmill.diagnosis.rounds import Search
from twinmill.diagnosis.settings import SETTINGS
from twinmill.diagnosis.trials import REFIT, Trial, without_effect
from twinmill.fitting.opening import Opened


def less_each(done: Search, opened: Sequence[Opened]) -> tuple[dict[str, Trial], Formulas | None]:
    """What was found, each with the final state refitted without it; what is outdone is dropped.

    And the formulas over the logs as the final model moves.

    Args:
        done: what is outdone moves from its findings to what was dropped.
        opened: its measurements, in its order.
    """
    less = {n: without_effect(done.last, n) for n in dict.fromkeys(done.found) if n != REFIT}
    formulas = formulas_of(opened, done.last.fit)
    for name in list(less):
        if formulas and better_formula(formulas, less[name], done.last):
            done.last = less[name]
            done.dropped.append(name)
            less = {n: without_effect(done.last, n) for n in less if n != name}
            formulas = formulas_of(opened, done.last.fit)
    return less, formulas


def better_formula(formulas: Formulas, less: Trial, whole: Trial) -> Term | None:
    """The formula that outdoes an effect, if there is one, and does what the effect does.

    Args:
        formulas: over the logs.
        less: without the effect.
        whole: with it; the way from one to the other is the effect as it was found.
    """
    before, _ = less.fit.state
    after, _ = whole.fit.state
    effect = [before[i] - after[i] for i, _ in formulas.logs]
    products = formulas.products(less.fit, effect)
    own, *gains = products.each_held_out()
    least = max(SETTINGS.outdoes * own, max(own, 0.0) + SETTINGS.outdoes_by)
    for k in np.argsort(gains)[::-1]:
        if gains[k] <= least:
            return None
        both = np.isin(np.arange(1 + len(gains)), [0, 1 + k])
        beside = products.held_out(both, 0)[0] - gains[k]
        if beside < SETTINGS.kept * own:
            return formulas.terms[k]
    return None
