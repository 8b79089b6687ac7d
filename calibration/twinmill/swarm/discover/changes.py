# SPDX-License-Identifier: Apache-2.0
"""A request whose single-valued axes have become part of its model's text."""

from dataclasses import replace

import tomlkit
import twinmill_native as native

from twinmill.swarm.axes import QUANTITIES
from twinmill.swarm.request import Request


def with_changes(request: Request) -> Request:
    """The same swarm without axes.

    Raises:
        ValueError: an axis has several values, or is no quantity of the model file.
    """
    model, document = request.model, tomlkit.parse(request.model_text)
    before = {row["name"]: row["value"] for row in model.values()}
    for axis in request.axes:
        quantity = QUANTITIES.get(axis.name)
        if len(axis.values) > 1 or (quantity and not quantity.set):
            raise ValueError(
                f"--set {axis.name}: takes one value of a quantity of the model, as in "
                "sensor.range_m=0.8."
            )
        _apply(model, axis.name, axis.values[0])
    for row in model.values():
        if row["value"] == before[row["name"]]:
            continue
        section, _, key = row["name"].partition(".")
        if section not in document and section not in ("idiosyncrasy", "noise", "robot", "sensor"):
            raise ValueError(f"--set {row['name']}: write what an effect has into the model file.")
        document.setdefault(section, tomlkit.table())[key] = row["value"]
    text = tomlkit.dumps(document)
    native.Model.from_toml(text, request.model_name)
    return replace(request, model_text=text, axes=[])


def _apply(model: native.Model, name: str, value: float) -> None:
    quantity = QUANTITIES.get(name)
    if quantity and quantity.set:
        quantity.set(model, value)
    else:
        model.set(name, value)
