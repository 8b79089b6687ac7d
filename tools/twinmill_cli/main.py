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
from twinmill_cli.word_order import in_order

# Name, module (of this package unless another is named) and what it does. The modules are imported
# when called.
COMMANDS = (
    (
        "demo",
        "demo",
        "Blind test: find two effects that are hidden in a simulated robot.",
    ),
    (
        "guide",
        "guide",
        "Ask for your equipment, and write a plan from an unknown robot to a named effect.",
    ),
    (
        "import",
        "import_log",
        "Make a log from motion capture exports and command tables, or of poses alone.",
    ),
    (
        "import-joints",
        "import_joints",
        "Make a log of joints for an MJCF from a table, a ROS bag or a LeRobot data set.",
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
        "Calibrate a camera's lens from a film of a board that is moved in front of it.",
    ),
    (
        "track-check",
        "track",
        "Check the accuracy of poses: a printed sheet pushed by hand along a ruler.",
    ),
    (
        "export-model",
        "export_model",
        "Export a model to other simulators, and list what their format cannot represent.",
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
        "Inspect a model's errors, change parameters, diagnose and add effects, in the browser.",
    ),
    (
        "compare",
        "calibrate",
        "Measure prediction errors of a model on logs, relative to the noise floor.",
    ),
    (
        "compare-runs",
        "compare_runs",
        "Tell whether anything changed between two runs of one robot: what, how much, since when.",
    ),
    (
        "drift",
        "drift",
        "Plot a robot's parameters over its calibrations, and test which have drifted.",
    ),
    (
        "fit",
        "calibrate",
        "Fit the parameters of a model to logs, into a new model file.",
    ),
    (
        "add",
        "calibrate",
        "Add an effect to a model, fit it with all other parameters, and cross-validate it.",
    ),
    (
        "set",
        "set_values",
        "Set parameters of a model by hand, into a new model file.",
    ),
    (
        "diagnose",
        "diagnose",
        "Name the physical effect that a model lacks, or say that none is missing or identifiable.",
    ),
    (
        "explain",
        "diagnose",
        "Diagnose, add the effects found, and write the new model.",
    ),
    (
        "next",
        "next",
        "Design the run that best discriminates what these logs cannot, and write its script.",
    ),
    (
        "challenge",
        "twinmill_lab.challenge.command",
        "Blind tests: simulate robots with hidden effects, diagnose their logs, and score "
        "the answers.",
    ),
    (
        "effects",
        "effects",
        "List the physical effects that a model can have, or show one with its equation.",
    ),
    (
        "flash",
        "flash",
        "Install the robot's program on several robots at once, and check that each runs.",
    ),
    (
        "characterise",
        "characterise",
        "Play an input script on one robot's wheels, and log its telemetry and poses.",
    ),
    (
        "metrics",
        "metrics",
        "Metrics of the swarm in a log or on the bus over time, and the class of its behaviour.",
    ),
    (
        "compare-swarm",
        "compare_swarm",
        "Tell whether a recorded swarm behaves as the twin's swarms do, and since when not.",
    ),
    (
        "phase",
        "phase",
        "Draw the phase diagram of a sweep, and where to experiment next.",
    ),
    (
        "predict-floor",
        "predict_floor",
        "Preregister a prediction: choose the most informative cells of a sweep, plan their runs.",
    ),
    (
        "score-floor",
        "score_floor",
        "Score a preregistered prediction by the outcomes of the runs, against simpler ones.",
    ),
    (
        "matters",
        "matters",
        "Sensitivity analysis: which effects and parameters change what the swarm does.",
    ),
    ("ask", "ask", "Answer a design question (how many robots, how fast) by simulation."),
    (
        "claims",
        "twinmill_lab.claims.command",
        "Check published claims about these swarms, with a figure of each.",
    ),
    (
        "discover",
        "discover",
        "Search controllers, and mixes of two, for new behaviours of the swarm.",
    ),
    (
        "threshold",
        "threshold",
        "Find the colour limits that select the green ball, and nothing else.",
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
    "import": {"joints": "import-joints"},
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
        "challenge": "challenge",
        "claims": "claims",
        "discover": "discover",
        "predict": "predict-floor",
        "score": "score-floor",
    },
}
GROUPS = {
    "twin": "Change a model by hand, list effects, export to other simulators.",
    "robot": "Set up a robot, drive it, and test whether it has changed.",
    "lab": "Blind tests, preregistered predictions, claims, new behaviours.",
}


class Commands(TyperGroup):
    """Commands of `TOP` with those below them; each under its flat name, too."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        told = {name: (module, summary) for name, module, summary in COMMANDS}
        for name in TOP:
            below = {
                new: LazyCommand(new, *told[old], registered=old)
                for new, old in BELOW.get(name, {}).items()
            }
            if name in GROUPS:
                summary, own = GROUPS[name], [*below.values()]
                self.add_command(
                    TyperGroup(name=name, help=summary, commands=own, no_args_is_help=True)
                )
            else:
                command = LazyCommand(name, *told[name])
                command.below = below
                self.add_command(command)
        for first, words in BELOW.items():
            for new, old in words.items():
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
    """Compare a robot's log with its model, and improve the model as far as the log allows.

    Lengths in m, angles in rad, times in s; text for people uses mm and degrees.

    `twinmill --install-completion` lets the shell complete commands and options.

    Exit codes: 0 done, 1 failed (one sentence on stderr), 2 wrong command line, 3 something
    changed (robot compare, robot drift), 130 stopped.
    """
    context.with_resource(spelled(typed))


def run(arguments: list[str]) -> Any:
    """Runs one command line without the leading `twinmill`.

    Returns:
        What the subcommand found, or an exit code where it asked for one.

    Raises:
        ValueError, OSError: it failed, in one sentence.
    """
    return app(in_order(arguments), prog_name="twinmill", standalone_mode=False)


def main() -> None:
    """Entry point: leaves with the exit code."""
    leave("twinmill", run, verbs=BELOW["swarm"])


if __name__ == "__main__":
    main()
