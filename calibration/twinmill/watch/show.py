# SPDX-License-Identifier: Apache-2.0
"""Takes batches of messages to the viewer, and asks for a score once a second."""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import rerun as rr

from twinmill.data.log import LogError
from twinmill.data.multi_log import multi_log_of
from twinmill.data.stream import Batch, Window
from twinmill.model.model_file import ModelFile
from twinmill.model.outlines import Body
from twinmill.watch.live_score import WINDOW_S, LiveScorer
from twinmill.watch.scene import GROUPS, Shown, layout

SCORE_EVERY_S = 1.0
PATH_EVERY_S = 0.2
ROBOT = re.compile(rf"({'|'.join(p for p in GROUPS if p)})?(R\d{{2,4}})_(TELEMETRY|POSE|DRIVE|RUN)")


def open_stream(
    name: str | None, prefixes: Sequence[str], file: Path | None, url: str
) -> rr.RecordingStream:
    """Where all goes: a file, a viewer at `url`, or without both one that is started here.

    Args:
        name: of the recording; None for a new one.
        prefixes: as for layout().
        file: .rrd.
        url: rerun+http://HOST:PORT/proxy.
    """
    stream = rr.RecordingStream("twinmill", recording_id=name)
    # Only the log's own time: the same log gives the same recording.
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    blueprint = layout(prefixes)
    if file:
        stream.save(file, default_blueprint=blueprint)
    elif url:
        stream.connect_grpc(url, default_blueprint=blueprint)
    else:
        stream.spawn(default_blueprint=blueprint)
    return stream


class Show:
    """Everybody who was heard.

    Attributes:
        shown: by R<nn> with the channel prefix.
        scores: newest, by the same name.
        messages: how many were taken in.
    """

    def __init__(self, to: rr.RecordingStream, model_file: ModelFile):
        self.shown: dict[str, Shown] = {}
        self.scores: dict[str, float] = {}
        self.messages = 0
        self._to, self._model_file = to, model_file
        self._body = Body.of(model_file.model)
        self._scorers: dict[str, LiveScorer] = {}
        self._window = Window(WINDOW_S)
        self._start_us: int | None = None
        self._scored_s = self._drawn_s = 0.0

    def run(self, batches: Iterable[tuple[int, Batch]]) -> None:
        """Shows all batches, one after the other."""
        for now_us, batch in batches:
            self._take(batch)
            self._window.add(now_us, batch)
            now_s = 0.0 if self._start_us is None else (now_us - self._start_us) / 1e6
            if now_s >= self._drawn_s + PATH_EVERY_S:
                self._drawn_s = now_s
                for shown in self.shown.values():
                    shown.path(now_s)
            if now_s >= self._scored_s + SCORE_EVERY_S:
                self._scored_s = now_s
                self._score(now_s)

    def _take(self, batch: Batch) -> None:
        for channel, payloads in batch.by_channel.items():
            match = ROBOT.fullmatch(channel)
            if not match:
                continue
            stamps_us = batch.stamps_us[channel]
            if self._start_us is None:
                self._start_us = min(min(stamps) for stamps in batch.stamps_us.values())
            self.messages += len(payloads)
            prefix, name, kind = match[1] or "", match[2], match[3]
            if prefix + name not in self.shown:
                self.shown[prefix + name] = Shown(self._to, prefix, name, self._body)
            t_s = (np.array(stamps_us) - self._start_us) / 1e6
            if kind == "POSE":
                self.shown[prefix + name].poses(t_s, payloads)
            elif kind == "TELEMETRY":
                self.shown[prefix + name].telemetry(t_s, payloads)

    def _score(self, now_s: float) -> None:
        """Robots' scores; the twins' where there is no robot."""
        try:
            robots = multi_log_of(self._window.events(), Path("the bus")).robots
        except LogError:
            return  # nobody has said enough
        robots = [recorded for recorded in robots if not recorded.prefix] or robots
        for recorded in robots:
            scorer = self._scorers.setdefault(recorded.name, LiveScorer(self._model_file))
            found = scorer.score(recorded)
            if found is not None:
                self.scores[recorded.name] = found.score
                self.shown[recorded.name].scored(now_s, found)
