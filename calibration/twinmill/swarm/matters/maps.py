# SPDX-License-Identifier: Apache-2.0
"""Phase diagrams before and after the changes that matter most."""

from dataclasses import replace

from twinmill.swarm.axes import Axis
from twinmill.swarm.matters.sensitivity import FactorResult, Sensitivity
from twinmill.swarm.matters.sentences import label
from twinmill.swarm.request import Request

MOST = 5  # changes
KINDS = ("effect", "hidden", "one_robot")


def map_requests(found: Sensitivity, axes: list[Axis], seeds: int) -> dict[str, Request]:
    """Sweeps by what they are of: the model as it is first.

    All effects of the model come first, then what moves the share most.

    Args:
        found: the answers.
        axes: of the diagrams.
        seeds: of each cell; 0: no diagrams.
    """
    if not seeds:
        return {}
    own = [j for j in found.ranked if j.factor.kind == "effect"]
    others = [j for j in found.ranked if j.factor.kind in KINDS and j not in own]
    chosen: list[FactorResult] = [*own, *others][:MOST]
    base = replace(found.request, axes=axes, seeds=seeds, n=None, same_seeds=True)
    if all(axis.name != "n" for axis in axes):
        base = replace(base, n=found.request.n)
    changed = {label(j): replace(base, model_text=j.worst.change.text) for j in chosen}
    return {"as it is": base, **changed}
