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
from typing import TYPE_CHECKING, Any

from twinmill.programs import use_own_libraries, use_own_models
from twinmill.version import __version__ as __version__

if TYPE_CHECKING:  # for editors and type checkers; the same names as below
    from twinmill.api import Addition as Addition
    from twinmill.api import Diagnosis as Diagnosis
    from twinmill.api import Explanation as Explanation
    from twinmill.api import Finding as Finding
    from twinmill.api import Fit as Fit
    from twinmill.api import Log as Log
    from twinmill.api import Model as Model
    from twinmill.api import compare as compare
    from twinmill.api import compare_models as compare_models
    from twinmill.api import compare_runs as compare_runs
    from twinmill.api import diagnose as diagnose
    from twinmill.api import effect as effect
    from twinmill.api import effects as effects
    from twinmill.api import explain as explain
    from twinmill.api import fit as fit
    from twinmill.api import import_log as import_log
    from twinmill.api import load as load
    from twinmill.api import next_run as next_run
    from twinmill.api import simulate as simulate
    from twinmill.data.log import LogError as LogError
    from twinmill.defaults import Certainty as Certainty
    from twinmill.defaults import Verdict as Verdict
    from twinmill.estimation.settings import FitSettings as FitSettings
    from twinmill.joint_results import Excitation as Excitation
    from twinmill.joint_results import ImportedJoints as ImportedJoints
    from twinmill.joint_results import JointComparison as JointComparison
    from twinmill.joint_results import JointDiagnosis as JointDiagnosis
    from twinmill.joint_results import JointExplanation as JointExplanation
    from twinmill.joint_results import compare_joints as compare_joints
    from twinmill.joint_results import diagnose_joints as diagnose_joints
    from twinmill.joint_results import explain_joints as explain_joints
    from twinmill.joint_results import import_joints as import_joints
    from twinmill.joint_results import next_joints as next_joints
    from twinmill.joints.log import JointLog as JointLog
    from twinmill.model.model_file import ModelError as ModelError
    from twinmill.model.python_effect import Number as Number
    from twinmill.model.python_effect import PythonEffect as PythonEffect
    from twinmill.model.python_effect import python_effect as python_effect
    from twinmill.results import Comparison as Comparison
    from twinmill.results import Effect as Effect
    from twinmill.results import NextRun as NextRun
    from twinmill.results import RunComparison as RunComparison
    from twinmill.results import SwarmComparison as SwarmComparison

# Where each public name is; imported when it is first used.
_HOME = {
    "Certainty": "twinmill.defaults",
    "Verdict": "twinmill.defaults",
    "FitSettings": "twinmill.estimation.settings",
    "LogError": "twinmill.data.log",
    **dict.fromkeys(
        (
            *("Excitation", "ImportedJoints", "JointComparison"),
            *("JointDiagnosis", "JointExplanation"),
            *("compare_joints", "diagnose_joints", "explain_joints"),
            *("import_joints", "next_joints"),
        ),
        "twinmill.joint_results",
    ),
    "JointLog": "twinmill.joints.log",
    "ModelError": "twinmill.model.model_file",
    **dict.fromkeys(("Number", "PythonEffect", "python_effect"), "twinmill.model.python_effect"),
    **dict.fromkeys(
        (
            *("Addition", "Diagnosis", "Explanation", "Finding", "Fit"),
            *("Log", "Model"),
            *(
                "compare",
                "compare_models",
                "compare_runs",
                "diagnose",
                "effect",
                "effects",
                "explain",
                "fit",
                "import_log",
            ),
            *("load", "next_run", "simulate"),
        ),
        "twinmill.api",
    ),
    **dict.fromkeys(
        ("Comparison", "Effect", "NextRun", "RunComparison", "SwarmComparison"),
        "twinmill.results",
    ),
}
__all__ = sorted(_HOME)


use_own_models()
use_own_libraries()


if not TYPE_CHECKING:  # who checks types knows all names from above

    def __getattr__(name: str) -> Any:
        if name not in _HOME:
            raise AttributeError(f"module 'twinmill' has no attribute '{name}'")
        return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
