# SPDX-License-Identifier: Apache-2.0
"""`twinmill swarm watch`: robots and their twins side by side, while they drive or from a log."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from twinmill.counted import counted
from twinmill.defaults import DEFAULT_MODEL, FOREVER_S, URL
from twinmill_cli.lazy import working
from twinmill_cli.options import DurationS, LcmUrl, Model
from twinmill_cli.output import AsJson, deliver, say

if working():  # not for --help
    from rich.progress import track

    from twinmill.data.multi_log import PREFIXES
    from twinmill.data.stream import Batch, from_bus, from_log
    from twinmill.extras import needing
    from twinmill.files import check_new_file, replacing
    from twinmill.model.model_file import ModelFile
    from twinmill.terminal import PlainConsole
    from twinmill.version import __version__
    from twinmill.watch.live_score import WINDOW_S
    from twinmill_cli.frame import open_model

if TYPE_CHECKING:  # it needs the extra `watch`
    from twinmill.watch.show import Show


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("watch")(_watch)


def _watch(
    *,
    log: Annotated[
        Path | None,
        typer.Argument(metavar="[LOG]", show_default=False, help="A log instead of the bus."),
    ] = None,
    model: Model = DEFAULT_MODEL,
    lcm_url: LcmUrl = URL,
    save: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write a recording for the viewer (.rrd); no display."),
    ] = None,
    connect: Annotated[
        str, typer.Option(metavar="URL", help="A viewer that runs, rerun+http://HOST:9876/proxy.")
    ] = "",
    spawn: Annotated[
        bool, typer.Option("--spawn", help="Start the viewer here; so it is without the others.")
    ] = False,
    duration_s: DurationS = FOREVER_S,
    force: Annotated[bool, typer.Option("--force", help="Replace FILE if it exists.")] = False,
    as_json: AsJson = False,
) -> dict[str, Any]:
    """Show robots and their twins (channels TWIN_...) side by side in the viewer Rerun.

    From above: paths, headings, what each camera looks over, green while it
    sees a neighbour; orange, where the model would have the robot go from two
    seconds ago. Over time: bits, and the model's score over the last 30 s.

    Example: twinmill swarm watch run.lcmlog --save run.rrd
    """
    if sum([save is not None, bool(connect), spawn]) > 1:
        raise ValueError("--save, --connect and --spawn: give one of them.")
    with needing("watch"):
        import rerun  # noqa: F401
    model_file = open_model(model, None)
    warnings: list[str] = []
    if save:
        check_new_file(save, force, [log, model_file.path])
    batches = from_log(log, warnings) if log else from_bus(lcm_url, duration_s, say)
    with replacing(save, force) if save else nullcontext() as file:
        show = _show(batches, model_file, log.name if log else None, file, url=connect)
    command = shlex.join(
        ["twinmill", "swarm", "watch", *([str(log)] if log else []), "--model", model]
    )
    source = {"command": command, "version": f"twinmill {__version__}"}
    data = {
        "saved": str(save) if save else None,
        "messages": show.messages,
        "robots": sorted(show.shown),
        "scores": show.scores,
        "model_sha256": model_file.hash,
        "warnings": warnings,
        **source,
    }
    deliver(data, _text(show, save, warnings), as_json)
    return data


def _show(
    batches: Iterable[tuple[int, Batch]],
    model_file: ModelFile,
    log_name: str | None,
    file: Path | None,
    *,
    url: str,
) -> Show:
    """Shows all batches, with progress for a log, until they end or Ctrl-C."""
    from twinmill.watch.show import Show, open_stream

    prefixes: Sequence[str] = PREFIXES
    if log_name:
        names = {name for _, batch in batches for name in batch.by_channel}
        prefixes = [p for p in PREFIXES if any(name.startswith(f"{p}R") for name in names)]
        console = PlainConsole(stderr=True)
        quiet = not console.is_terminal
        batches = track(batches, "showing", console=console, transient=True, disable=quiet)
    stream = open_stream(log_name, prefixes, file, url)
    show = Show(stream, model_file)
    try:
        show.run(batches)
    except KeyboardInterrupt:
        pass  # the way to end a bus
    finally:
        stream.flush()
        stream.disconnect()
    return show


def _text(show: Show, save: Path | None, warnings: list[str]) -> str:
    scores = ", ".join(f"{name} {score:.2f}" for name, score in sorted(show.scores.items()))
    told = f"score of the last {WINDOW_S:g} s: {scores}"
    return "\n".join(
        [
            f"{counted(show.messages, 'message')} of {counted(len(show.shown), 'robot')}"
            + (f": {save}; look at it with: rerun {save}" if save else ""),
            told if scores else "no score: too little was heard",
            *(f"! {warning}" for warning in warnings),
        ]
    )
