# SPDX-License-Identifier: Apache-2.0
"""A robot's form as a model file: drive, wheels and geometry, without what any log told."""

import tomllib
from collections.abc import Sequence

import tomlkit
import twinmill_native as native

from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import BASE_GAINS, GAINS, LAG, duty_table, key_of

TOLD = ("effect", "robots", "fit", "noise", "idiosyncrasy", "parent", "created_by", *GAINS)
FITTED = ("std", "fitted_on")  # of the base
NUMBERS = (*BASE_GAINS, LAG)  # of a form, beside its duty table
USUAL_LAG_S = 0.06  # of a cheap geared motor, as twin/models/turbopi has it
TOP_MPS = 0.36  # of a TurboPi's wheel at full duty; a log's own scale is found from there


def form_file(model_file: ModelFile, duty_pct: Sequence[float], *, clock: bool) -> ModelFile:
    """The form of a file's robot: no effect, gains of 1, a usual lag, speeds proportional to duty.

    Args:
        model_file: of the robot.
        duty_pct: nodes of its table, 0 first, if it is told duties.
        clock: the offset of the clocks stays as the file has it.
    """
    document = tomllib.loads(model_file.text)
    for name in (*TOLD, *(() if clock else ("clock",))):
        document.pop(name, None)
    base = document["base"]
    for name in (*FITTED, *map(key_of, BASE_GAINS), "steering_lag_s"):
        base.pop(name, None)
    base[key_of(LAG)] = USUAL_LAG_S
    if model_file.model.drive == "duty":
        base["duty_pct"] = list(duty_pct)
        base["wheel_speed_mps"] = [TOP_MPS * duty / 100 for duty in duty_pct]
    return ModelFile.of(model_file.path, tomlkit.dumps(document))


def with_numbers(form: ModelFile, base: native.Model) -> ModelFile:
    """A form with the gains, speeds and lag of another model on the same nodes."""
    document = tomllib.loads(form.text)
    for name in NUMBERS:
        document["base"][key_of(name)] = base.get(name)
    if table := duty_table(base):
        document["base"]["wheel_speed_mps"] = [0.0, *map(base.get, table)]
    return ModelFile.of(form.path, tomlkit.dumps(document))
