# SPDX-License-Identifier: Apache-2.0
"""Sets numbers of a model by hand; what fits told of them is taken out of the new file."""

import difflib
import math
from collections.abc import Mapping
from typing import Any

import tomlkit

from twinmill.model.model_file import ModelError, ModelFile
from twinmill.model.parameters import catalogue, catalogue_name, effect_names

SECTIONS = ("robot", "base", "sensor", "noise", "idiosyncrasy", "clock")


def with_values(parent: ModelFile, values: Mapping[str, float], command: str) -> str:
    """Text of a model file that differs from its parent in these numbers alone.

    Args:
        parent: the model.
        values: by full name, such as `base.motor_lag_s` or `coasting.deceleration_mps2`; written
            with six digits.
        command: recorded in the file.

    Raises:
        ModelError: there is no such quantity, or a value is outside its bounds.
    """
    document = tomlkit.parse(parent.text)
    document["parent"] = parent.hash
    document["created_by"] = command
    bounds = {v["name"]: v for v in parent.model.values()}
    for name, value in values.items():
        _check(name, value, bounds)
        _set(document, parent, name, float(f"{value:.6g}"))
    _forget_fit(document, parent, values)
    return tomlkit.dumps(document)


def _check(name: str, value: float, bounds: Mapping[str, dict[str, Any]]) -> None:
    known = [own for own in bounds if not own.startswith("theta_")]
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        hint = f"; the nearest known is '{near[0]}'" if near else ""
        effect = catalogue_name(name)
        how = (
            f"; the model has no {effect}: add the lines [[effect]] and name = "
            f'"{effect}" to its file'
            if effect in catalogue()
            else hint
        )
        raise ModelError(
            f"{name}: is no quantity of this model{how} (`twinmill open` shows all with their "
            "bounds)."
        )
    low, high = bounds[name]["min"], bounds[name]["max"]
    if not low <= value <= high:
        raise ModelError(f"{name} = {value:g}: must be within {low:g} to {high:g}.")


def _set(document: tomlkit.TOMLDocument, parent: ModelFile, name: str, value: float) -> None:
    owner, *key = name.split(".")
    if owner in SECTIONS:
        table = document.setdefault(owner, tomlkit.table())
    else:
        table = document["effect"][effect_names(parent.model).index(owner)]
    stds = table.get("std", {})
    if len(key) == 2:  # an entry of a table
        table[key[0]][int(key[1])] = value
        if key[0] in stds:
            stds[key[0]][int(key[1])] = math.nan
        return
    table[key[0]] = value
    stds.pop(key[0], None)
    if "std" in table and not stds:
        table.pop("std")
        table.pop("fitted_on", None)


def _forget_fit(
    document: tomlkit.TOMLDocument, parent: ModelFile, names: Mapping[str, float]
) -> None:
    """Scores of a fit do not hold any more, and what was set is not uncertain with the rest."""
    if "fit" not in document:
        return
    told = parent.covariance
    left = told.of(set(told.names) - set(names))
    document.pop("fit")
    if left.names:
        document["fit"] = {"covariance": left.to_toml()}
