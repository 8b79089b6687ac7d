# SPDX-License-Identifier: Apache-2.0
"""The command `twinmill`: all subcommands, and one sentence on what went wrong."""

import sys
from importlib.metadata import version
from typing import Annotated, Any

import typer
from twinmill.tools import (
    calibrate,
    characterise,
    compare_swarm,
    diagnose,
    effects,
    import_log,
    metrics,
    plot,
)
from twinmill.tools import next as next_run
from twinmill.tools.challenge import run as challenge
from twinmill.tools.deploy import flash
from twinmill.tools.discover import command as discover
from twinmill.tools.export import command as export
from twinmill.tools.swarm import commands as swarm
from twinmill.tools.sweep import ask
from twinmill.tools.sweep import phase_command as phase
from twinmill.tools.threshold import command as threshold
from twinmill.tools.watch import command as watch

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
import_log.register(app)
export.register(app)
plot.register(app)
watch.register(app)
calibrate.register(app)
diagnose.register(app)
next_run.register(app)
challenge.register(app)
effects.register(app)
swarm.register(app)
flash.register(app)
characterise.register(app)
metrics.register(app)
compare_swarm.register(app)
phase.register(app)
ask.register(app)
discover.register(app)
threshold.register(app)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"twinmill {version('twinmill')}")
        raise typer.Exit


@app.callback()
def _options(
    show_version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Compare a robot's log with its model, and make the model as good as the log can tell.

    Lengths in m, angles in rad, times in s; what is printed for people says mm and degrees.

    Exit codes: 0 done, 1 failed (one sentence on stderr), 2 wrong command line.
    """


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
    try:
        result = run(sys.argv[1:] or ["--help"])
        code = result if isinstance(result, int) else 0
    except typer.TyperException as error:
        code = error.exit_code
        sentence = error.format_message()  # empty where help was printed instead
        if sentence:
            _complain(f"{sentence} (--help lists what can be given)" if code == 2 else sentence)
    except (ValueError, OSError) as error:
        code = 1
        _complain(str(error))
    sys.exit(code)


def _complain(sentence: str) -> None:
    print(f"twinmill: {' '.join(sentence.split())}", file=sys.stderr)


if __name__ == "__main__":
    main()
