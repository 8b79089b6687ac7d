# SPDX-License-Identifier: Apache-2.0
"""A model as one JSON object: all its numbers, and what each effect says."""

from typing import Any

import numpy as np
import tomlkit

from twinmill.export.carried import RobotModel
from twinmill.model.ranges import quantities

EFFECT_KEYS = ("summary", "stage", "equation", "leaves_out", "reference")


def model_json(robot: RobotModel) -> dict[str, Any]:
    """Everything: base, effects with their equations, intervals, covariance, noise, camera.

    Names are the model file's own, each with value, unit, bounds and meaning.
    """
    document = tomlkit.parse(robot.file.text).unwrap()
    known = {q.name: q for q in quantities(robot.file, robot.model)}
    numbers = {}
    for v in robot.model.values():
        q = known.get(v["name"])
        numbers[v["name"]] = {
            "value": v["value"],
            "unit": v["unit"],
            "std": q.std if q else None,
            "interval": list(q.interval) if q else None,
            "min": v["min"],
            "max": v["max"],
            "doc": v["doc"],
        }
    covariance = robot.file.covariance
    base = document.get("base", {})
    return {
        "name": robot.name,
        "description": document.get("description"),
        "model": str(robot.file.path),
        "model_sha256": robot.file.hash,
        "parent": document.get("parent"),
        "drive": robot.model.drive,
        "wheel_kind": robot.model.wheel_kind,
        "wheels": robot.model.wheels(),
        "duty_pct": base.get("duty_pct") if robot.model.drive == "duty" else None,
        "numbers": numbers,
        "effects": [_effect(robot, i) for i in range(len(robot.model.effects))],
        "sight": robot.model.detection_model(),
        "robots": document.get("robots", {}),
        "covariance": {"names": list(covariance.names), "values": covariance.values},
        "fit": {k: v for k, v in document.get("fit", {}).items() if k != "covariance"},
    }


def _effect(robot: RobotModel, i: int) -> dict:
    instance, card, values = robot.effects()[i]
    share, others = robot.share_of(instance)
    return {
        "name": card["name"],
        "instance": instance,
        **{key: card[key] for key in EFFECT_KEYS},
        "texts": robot.model.texts[i],
        "parameters": {
            p["name"]: {"value": values[p["name"]], "unit": p["unit"], "doc": p["doc"]}
            for p in card["parameters"]
        },
        "share": None if share is None or not np.isfinite(share) else share,
        "share_together_with": list(others),
    }
