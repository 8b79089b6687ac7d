# SPDX-License-Identifier: Apache-2.0
"""The command `twinmill`: all subcommands, and one sentence on what went wrong."""

import os
import sys
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from twinmill.arguments import spelled
from twinmill_cli.ending import leave
from twinmill_cli.lazy import LazyCommand
from twinmill_cli.spelling import typed

# Name, module and what it does. The modules are imported when called.
COMMANDS = (
    (
        "demo",
        "demo",
        "Find two effects that were hidden in a simulated robot, and unseal what they were.",
    ),
    (
        "guide",
        "guide",
        "Ask what you have, and write the plan from an unknown robot to a named effect.",
    ),
    (
        "import",
        "import_log",
        "Make a log from motion capture exports and command tables, or of poses alone.",
    ),
    (
        "export",
        "export",
        "Write a log as MCAP for Foxglove, as a ROS bag, or as tables, CSV or Parquet.",
    ),
    ("tags", "tags", "Print tags for robots, to scale, for `twinmill track`."),
    (
        "track",
        "track",
        "Find tagged robots in films of cameras over the floor, and write their poses.",
    ),
    (
        "optitrack",
        "optitrack",
        "Publish the poses that OptiTrack Motive streams (NatNet), or say why none arrive.",
    ),
    (
        "track-calibrate",
        "track",
        "Find a camera's lens from a film of a board that is moved about before it.",
    ),
    (
        "track-check",
        "track",
        "Compare poses of a printed sheet with the ruler along which a hand pushed it.",
    ),
    (
        "export-model",
        "export_model",
        "Write a model for other simulators, and name what their file cannot carry.",
    ),
    (
        "wheels",
        "wheels",
        "Write a script that drives one wheel at a time; with its LOG, say what each wheel did.",
    ),
    ("plot", "plot", "Draw paths, speeds, bits and wheel commands of all robots in a log."),
    (
        "watch",
        "watch",
        "Show robots and their twins (channels TWIN_...) side by side in the viewer Rerun.",
    ),
    (
        "open",
        "open_workbench",
        "See where a model fails, turn its knobs, name and add what is missing, in the browser.",
    ),
    (
        "compare",
        "calibrate",
        "Tell how well a model predicts logs, against the log's own noise, and where it fails.",
    ),
    (
        "compare-runs",
        "compare_runs",
        "Tell whether anything changed between two runs of one robot: what, how much, since when.",
    ),
    (
        "drift",
        "drift",
        "Draw a robot's numbers over its calibrations, and tell which left its band.",
    ),
    (
        "fit",
        "calibrate",
        "Fit all quantities of a model to logs; writes a new model file and leaves the old one.",
    ),
    (
        "add",
        "calibrate",
        "Add an effect to a model, fit it with all the rest, and judge it on data not fitted to.",
    ),
    (
        "set",
        "set_values",
        "Set numbers of a model by hand; writes a new model file and leaves the old one.",
    ),
    (
        "diagnose",
        "diagnose",
        "Name the physical effect that a model lacks, or say that none is or "
        "that the log cannot tell.",
    ),
    (
        "infer",
        "infer",
        "Give the probability of each effect that a model may lack, and of something nameless.",
    ),
    (
        "explain",
        "diagnose",
        "Diagnose, add what is found, and write the model that has it; every "
        "step on held-out data.",
    ),
    (
        "next",
        "next",
        "Design the run that best tells apart what these logs cannot, and write its script.",
    ),
    (
        "challenge",
        "challenge",
        "Draw robots and what is hidden in them, seal the answers, diagnose their logs, "
        "unseal, score.",
    ),
    (
        "effects",
        "effects",
        "List the physical effects that a model can have, or show one with its equation.",
    ),
    (
        "flash",
        "flash",
        "Install the robot's program on robots, all at once, and see that each runs.",
    ),
    (
        "characterise",
        "characterise",
        "Play an input script on one robot's wheels, and log its telemetry and poses.",
    ),
    (
        "metrics",
        "metrics",
        "Tell what the swarm in a log or on the bus does: metrics over time, and its class.",
    ),
    (
        "compare-swarm",
        "compare_swarm",
        "Tell whether a recorded swarm behaves as the twin's swarms do, and since when not.",
    ),
    (
        "phase",
        "phase",
        "Draw what becomes of the swarm over a sweep's grid, and where to experiment next.",
    ),
    (
        "predict-floor",
        "predict_floor",
        "Choose the cells of a sweep that tell most, plan their runs, and seal what is predicted.",
    ),
    (
        "score-floor",
        "score_floor",
        "Unseal a prediction and score it by what came of the runs, against simpler predictions.",
    ),
    (
        "matters",
        "matters",
        "Tell which effects and numbers of a model matter for what the swarm does.",
    ),
    ("ask", "ask", "Answer a design question with a curve and a sentence."),
    (
        "claims",
        "claims",
        "Check what was published of these swarms, with a figure of each claim.",
    ),
    (
        "discover",
        "discover",
        "Search tables and mixes of two tables for behaviours that differ, and name what is known.",
    ),
    (
        "threshold",
        "threshold",
        "Find the limits of colour that hold the green ball, and nothing else.",
    ),
    (
        "swarm",
        "swarm",
        "Start, stop and watch the robots on the network, or those of twin_run.",
    ),
)


TOP = (
    *("demo", "guide", "import", "compare", "fit", "diagnose", "explain", "next", "open", "export"),
    *("twin", "swarm", "robot", "track", "lab"),
)
# The others by the first word of their names, and what they are called there.
BELOW = {
    "twin": {"effects": "effects", "add": "add", "set": "set", "export": "export-model"},
    "swarm": {
        "metrics": "metrics",
        "plot": "plot",
        "watch": "watch",
        "compare": "compare-swarm",
        "phase": "phase",
        "matters": "matters",
        "ask": "ask",
    },
    "robot": {
        "flash": "flash",
        "threshold": "threshold",
        "wheels": "wheels",
        "characterise": "characterise",
        "compare": "compare-runs",
        "drift": "drift",
    },
    "track": {
        "tags": "tags",
        "calibrate": "track-calibrate",
        "check": "track-check",
        "optitrack": "optitrack",
    },
    "lab": {
        "infer": "infer",
        "challenge": "challenge",
        "claims": "claims",
        "discover": "discover",
        "predict": "predict-floor",
        "score": "score-floor",
    },
}
GROUPS = {
    "twin": "Change a model by hand, list effects, write files for other simulators.",
    "robot": "Set up a robot, drive it, and see whether it changed since.",
    "lab": "Probabilities, sealed tests and predictions, published claims, new behaviours.",
}


class Commands(TyperGroup):
    """Commands of `TOP` with those below them; each under its flat name, too."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        told = {name: (f"twinmill_cli.{module}", summary) for name, module, summary in COMMANDS}
        for name in TOP:
            below = {
                new: LazyCommand(new, *told[old], registered=old)
                for new, old in BELOW.get(name, {}).items()
            }
            if name in GROUPS:
                summary = GROUPS[name]
                self.add_command(
                    TyperGroup(name=name, help=summary, commands=below, no_args_is_help=True)
                )
            else:
                command = LazyCommand(name, *told[name])
                command.below = below
                self.add_command(command)
        for first, below in BELOW.items():
            for new, old in below.items():
                if old not in self.commands:
                    self.add_command(LazyCommand(old, *told[old], renamed=f"{first} {new}"))


def _completes() -> bool:
    """True for the shell's completion, which takes long to import."""
    words = {"--install-completion", "--show-completion"}
    return "_TWINMILL_COMPLETE" in os.environ or bool(words & set(sys.argv[1:]))


app = typer.Typer(
    cls=Commands,
    add_completion=_completes(),
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        from twinmill.version import __version__

        typer.echo(f"twinmill {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    context: typer.Context,
    show_version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Compare a robot's log with its model, and make the model as good as the log can tell.

    Lengths in m, angles in rad, times in s; what is printed for people says mm and degrees.

    `twinmill --install-completion` lets the shell complete commands and options.

    Exit codes: 0 done, 1 failed (one sentence on stderr), 2 wrong command line, 3 something
    changed (compare-runs, drift), 130 stopped.
    """
    context.with_resource(spelled(typed))


def run(arguments: list[str]) -> Any:
    """Runs one command line without the leading `twinmill`.

    Returns:
        What the subcommand found, or an exit code where it asked for one.

    Raises:
        ValueError, OSError: it failed, in one sentence.
    """
    return app(arguments, prog_name="twinmill", standalone_mode=False)


def main() -> None:
    """Entry point: leaves with the exit code."""
    leave("twinmill", run)


if __name__ == "__main__":
    main()
