# SPDX-License-Identifier: Apache-2.0
"""A request whose single-valued axes have become part of its model's text."""

from dataclasses import replace

import twinmill_native as native

from twinmill.swarm.axes import QUANTITIES
from twinmill.swarm.model_text import with_values
from twinmill.swarm.request import Request


def with_changes(request: Request) -> Request:
    """The same swarm without axes.

    Raises:
        ValueError: an axis has several values, or is no quantity of the model file.
    """
    model = request.model
    before = {row["name"]: row["value"] for row in model.values()}
    for axis in request.axes:
        quantity = QUANTITIES.get(axis.name)
        if len(axis.values) > 1 or (quantity and not quantity.set):
            raise ValueError(
                f"--set {axis.name}: takes one value of a quantity of the model, as in "
                "sensor.range_m=0.8."
            )
        _apply(model, axis.name, axis.values[0])
    after = {row["name"]: row["value"] for row in model.values()}
    changed = {name: value for name, value in after.items() if value != before[name]}
    text = with_values(request.model_text, request.model, changed)
    native.Model.from_toml(text, request.model_name)
    return replace(request, model_text=text, axes=[])


def _apply(model: native.Model, name: str, value: float) -> None:
    quantity = QUANTITIES.get(name)
    if quantity and quantity.set:
        quantity.set(model, value)
    else:
        model.set(name, value)
