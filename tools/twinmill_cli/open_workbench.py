# SPDX-License-Identifier: Apache-2.0
"""`twinmill open`: logs and a model side by side in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from twinmill.defaults import DEFAULT_MODEL
from twinmill_cli.lazy import working
from twinmill_cli.options import Logs, Model

if working():  # not for --help
    from twinmill.extras import needing

    with needing("workbench"):
        from twinmill.workbench.bench import Bench
        from twinmill.workbench.server import serve
        from twinmill.workbench.session import Session
        from twinmill.workbench.state_file import StateFile, state_path


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("open")(_open)


def _open(
    logs: Logs,
    *,
    model: Model = DEFAULT_MODEL,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port on this machine; 0: any that is free.")
    ] = 0,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address alone.")
    ] = False,
    state: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            show_default=False,
            help="Where the session is kept; default: of these logs and this model, in "
            "~/.local/share/twinmill/workbench.",
        ),
    ] = None,
) -> None:
    """Inspect a model's errors, change parameters, diagnose and add effects, in the browser.

    Serves this machine alone, until Ctrl-C; the address holds a secret. What
    you did is kept: the same command opens it again.

    Example: twinmill open run.lcmlog --model fitted.toml
    """
    session = Session(logs, model)
    session.read()
    bench = Bench(session, StateFile(state or state_path(logs[0].stem, session.key)))
    serve(
        bench,
        port,
        not no_browser,
        lambda url: print(f"Workbench: {url}  (Ctrl-C ends it)", flush=True),
    )
