# SPDX-License-Identifier: Apache-2.0
"""From logs and a model to errors, causes and a better model; and what swarms do.

import twinmill as tm

log = tm.load("run.lcmlog")
model = tm.Model.load("turbopi.toml")
fit = model.fit(log)
fit.compare(log).plot()
d = tm.diagnose(log, fit.model)
better = d.best.add_to(fit.model) if d.best else fit.model
tm.simulate(better, n=8)
"""

from importlib import import_module
from typing import Any

from twinmill.programs import use_own_libraries, use_own_models

# Where each public name is; imported when it is first used.
_HOME = {
    "LogError": "twinmill.data.log",
    "ModelError": "twinmill.model.model_file",
    **dict.fromkeys(
        (
            *("Addition", "Comparison", "Diagnosis", "Finding", "Fit", "Log", "Model"),
            *("compare", "diagnose", "fit", "load", "simulate"),
        ),
        "twinmill.api",
    ),
}
__all__ = sorted(_HOME)


use_own_models()
use_own_libraries()


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return import_module("importlib.metadata").version("twinmill")
    if name not in _HOME:
        raise AttributeError(f"module 'twinmill' has no attribute '{name}'")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
