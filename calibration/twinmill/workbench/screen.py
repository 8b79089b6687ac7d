# SPDX-License-Identifier: Apache-2.0
"""The page: a bar, the stage with floor and series, and panels at the side. It only draws."""

import json
from collections import Counter

from nicegui import context, ui

from twinmill.charts.stage import stage_html
from twinmill.workbench.bench import Bench
from twinmill.workbench.fails_panel import FailsPanel
from twinmill.workbench.knobs_panel import KnobsPanel
from twinmill.workbench.missing_panel import MissingPanel
from twinmill.workbench.models_panel import ModelsPanel
from twinmill.workbench.next_panel import NextPanel
from twinmill.workbench.panel import markup, scored, tone
from twinmill.workbench.swarm_panel import SwarmPanel

REFRESH_S = 0.15
HINT_MS = 900  # over a tab, before its hint shows
HINTS = {
    "knobs": "Every quantity of the model, with its interval",
    "missing": "What is missing in the model",
    "fails": "Where it fails: error over noise floor, by what the robot was doing",
    "models": "All models tried, with their scores; save one",
    "next": "What to drive next",
    "swarm": "What a swarm would do with the model now",
}
HEAD = """
<link rel="stylesheet" href="/charts/charts.css">
<link rel="stylesheet" href="/look/workbench.css">
<link rel="stylesheet" href="/look/equation.css">
<link rel="modulepreload" href="/look/workbench.js">
"""
SCRIPT = """
<script type="module">import { start } from "/look/workbench.js"; start(OPTIONS);</script>
"""
TABS = {
    "knobs": "Knobs",
    "missing": "Missing",
    "fails": "Fails",
    "models": "Models",
    "next": "Next",
    "swarm": "Swarm",
}
VERBS = {
    "fit": "Fitting",
    "add": "Adding",
    "diagnose": "Diagnosing",
    "next": "Designing a run",
    "swarm": "Running the twin",
}
DRAWS = {  # what a panel shows
    "knobs": {"model", "robots"},
    "missing": {"findings", "model"},
    "fails": {"prediction", "robots", "model"},
    "models": {"model", "score", "work"},
    "next": {"plan"},
    "swarm": {"swarm"},
}


def _in_script(value: object) -> str:
    """JSON that ends no script, whatever texts are in it."""
    return json.dumps(value).replace("<", "\\u003c")


class Screen:
    """One page in one browser."""

    def __init__(self, bench: Bench, token: str) -> None:
        self.bench, self.token = bench, token
        self._seen: Counter[str] = Counter()
        self._stale: set[str] = set()

    async def build(self) -> None:
        """Makes all elements, then keeps them up to date."""
        place = self.bench.log_of(self.bench.picked)
        options = {"token": self.token, "view": self.bench.view, "log": place}
        ui.add_head_html(HEAD)
        ui.add_body_html(stage_html() + SCRIPT.replace("OPTIONS", _in_script(options)))
        self._bar()
        with ui.element("div").props("id=side"):
            self._panels()
        ui.on("undo", lambda: self._act(self.bench.session.undo))
        ui.on("redo", lambda: self._act(self.bench.session.redo))
        ui.on("pick", lambda event: self._pick_label(event.args))
        ui.on("leave", self.bench.leave_beside)
        self.client = context.client
        await self.client.connected()
        self._stale = set(TABS)
        await self._refresh()
        ui.timer(REFRESH_S, self._refresh)

    # -- what it is made of ---------------------------------------------------------------------

    def _bar(self) -> None:
        with ui.element("div").props("id=bar"):
            markup('<span class="name"><img src="/look/icon.svg" alt="">Twinmill</span>')
            names = [path.name for path in self.bench.session.paths]
            self.log = ui.select(
                dict(enumerate(names)), value=0, on_change=lambda e: self._pick_log(e.value)
            ).props("dense options-dense borderless")
            self.log.set_visibility(len(names) > 1)
            self.robot = ui.select({}, on_change=lambda e: self._pick(e.value))
            self.robot.props('dense options-dense outlined data-testid="robot"')
            self.status = ui.label().classes("space").props('data-testid="status"')
            self.cancel = ui.button("Cancel", on_click=self.bench.cancel)
            self.cancel.props('dense outline no-caps padding="2px 12px" data-testid="cancel"')
            with ui.element("div").classes("score"):
                markup("<small>score</small>")
                self.score = ui.label().props('data-testid="score"')
                ui.tooltip(
                    "Error over the noise of the log, all robots: 1.0 is as good as the log can "
                    "tell, above 1.3 something is missing."
                )
            self.undo = ui.button(icon="undo", on_click=lambda: self._act(self.bench.session.undo))
            self.redo = ui.button(icon="redo", on_click=lambda: self._act(self.bench.session.redo))
            self.undo.props('flat dense round data-testid="undo"').tooltip("Undo (z)")
            self.redo.props('flat dense round data-testid="redo"').tooltip("Redo (y)")

    def _panels(self) -> None:
        chosen = self._tab
        with ui.tabs(on_change=lambda e: self._turn_to(e.value)) as self.tabs:
            self.tabs.props("dense no-caps inline-label align=justify")
            for key, label in TABS.items():
                with ui.tab(key, label=label).props(f'data-testid="tab-{key}"'):
                    above = 'anchor="top middle" self="bottom middle"'  # below is the panel's head
                    ui.tooltip(HINTS[key]).props(f"delay={HINT_MS} {above}")
        with ui.tab_panels(self.tabs, value=chosen).props("animated=false keep-alive"):
            with ui.tab_panel("knobs"):
                self.knobs = KnobsPanel(self)
            with ui.tab_panel("missing"):
                self.missing = MissingPanel(self)
            with ui.tab_panel("fails"):
                self.fails = FailsPanel(self)
            with ui.tab_panel("models"):
                self.models = ModelsPanel(self)
            with ui.tab_panel("next"):
                self.next = NextPanel(self)
            with ui.tab_panel("swarm"):
                self.swarm = SwarmPanel(self)

    # -- what the user does ---------------------------------------------------------------------

    async def _act(self, act, *arguments) -> None:
        await self.bench.act(act, *arguments)
        await self._refresh()

    async def start(self, kind: str, effect: str = "", options: dict | None = None) -> None:
        """A fit, an addition, a diagnosis, a next run or a swarm."""
        self._look_at((options or {}).get("robot_id"))
        await self.bench.start(kind, effect, options)
        await self._refresh()

    async def design(self) -> None:
        """Designs the run that parts what cannot be parted, in its panel."""
        self.tabs.set_value("next")
        await self.next.design()

    async def try_beside(self, effect: str, robot_id: int | None = None) -> None:
        """Draws what an effect would change."""
        self._look_at(robot_id)
        await self.bench.try_beside(effect, robot_id)
        await self._refresh()

    async def keep(self, name: str, value: float) -> None:
        """A knob was let go."""
        await self._act(self.bench.session.set, name, value)

    async def go(self, number: int) -> None:
        """To a model tried before."""
        await self._act(self.bench.session.go, number)

    def _look_at(self, robot_id: int | None) -> None:
        """Shows the robot that something is about."""
        if robot_id is not None and self._shown_robot != robot_id:
            self._pick(self.bench.session.place_of(robot_id))

    @property
    def _shown_robot(self) -> int:
        return self.bench.session.measurements[self.bench.picked].track.robot_id

    def _pick(self, index: int | None) -> None:
        if index is not None and index != self.bench.picked:
            self.bench.view["robot"] = int(index)
            self.bench.changed("robots")

    def _pick_label(self, label: str) -> None:
        labels = [m.label for m in self.bench.session.measurements]
        self._pick(labels.index(label) if label in labels else None)

    def _pick_log(self, place: int) -> None:
        robots = range(len(self.bench.session.measurements))
        first = next((k for k in robots if self.bench.log_of(k) == place), None)
        if self.bench.log_of(self.bench.picked) != place:
            self._pick(first)

    def javascript(self, code: str) -> None:
        """Runs in this page's browser."""
        self.client.run_javascript(code)

    # -- keeping up -----------------------------------------------------------------------------

    async def _refresh(self) -> None:
        """Draws what has changed since."""
        changes = self.bench.changes
        new = {key for key, count in changes.items() if count != self._seen[key]}
        self._seen = Counter(changes)
        if "robots" in new:
            self._draw_robots()
        elif new & {"model", "names"}:
            self._name_robots()
        if "prediction" in new and "robots" not in new:
            self.javascript(f"twinmill.renew({changes['prediction']})")
        if self.bench.failure and self.bench.opening and not self.bench.told.is_set():
            self.javascript(f"twinmill.fail({json.dumps(self.bench.failure)})")
            self.bench.told.set()
        if "work" in new or self.bench.doing:
            self._draw_status()
        if new & {"score", "model", "robots", "names"}:
            await self._draw_score()
        self._stale |= {tab for tab, what in DRAWS.items() if new & what}
        self._draw_tab()
        if "work" in new or self.bench.doing:
            for panel in (self.missing, self.next, self.swarm):
                panel.draw_progress()
        if "beside" in new:
            self.missing.draw_beside()

    @property
    def _tab(self) -> str:
        return self.bench.view.get("tab", "knobs")

    def _turn_to(self, tab: str) -> None:
        self.bench.view["tab"] = tab
        self._draw_tab()

    def _draw_tab(self) -> None:
        """The panel that is seen; the others once they are."""
        if self._tab in self._stale:
            self._stale.remove(self._tab)
            getattr(self, self._tab).draw()

    def _draw_robots(self) -> None:
        session, picked = self.bench.session, self.bench.picked
        self._name_robots()
        self.robot.set_visibility(len(session.measurements) > 1)
        place = self.bench.log_of(picked)
        self.log.set_value(place)
        if not self.bench.ready:
            return
        label = json.dumps(session.measurements[picked].label)
        self.javascript(f"twinmill.showLog({place}).then(() => twinmill.pick({label}, {picked}))")

    def _name_robots(self) -> None:
        """Those of the log that is shown, each with its score."""
        session, picked = self.bench.session, self.bench.picked
        scores, place = session.own_scores(), self.bench.log_of(picked)
        names = {
            k: m.label[-3:] + (f" · {scored(scores[k])}" if k in scores else "")
            for k, m in enumerate(session.measurements)
            if self.bench.log_of(k) == place
        }
        self.robot.set_options(names, value=picked if names else None)

    def _draw_status(self) -> None:
        bench = self.bench
        wrong = bench.failure or bench.unkept
        words = wrong or (f"{bench.opening} …" if bench.opening else "")
        if bench.doing:
            verb = VERBS[bench.doing.kind]
            words = f"{verb} {bench.doing.effect}".strip() + f": {bench.progress}"
        self.status.set_text(
            words or bench.session.tree.file_name(bench.session.tree.current.number)
        )
        self.status.classes(replace="space bad" if wrong else "space")
        self.cancel.set_visibility(bench.doing is not None)

    async def _draw_score(self) -> None:
        session, of = self.bench.session, self.bench.changes["score"]
        known = session.tree.scores.get(session.tree.current.number)
        if known and not (self.bench.ready and session.is_passing):
            self._say_score(known.fitted, known.exact)
        elif self.bench.ready:
            score = await self.bench.aside(session.passing_score, self.bench.picked)
            if self.bench.changes["score"] == of:
                self._say_score(score, False)
        self.undo.set_enabled(session.tree.can_undo)
        self.redo.set_enabled(session.tree.can_redo)
        self._draw_status()

    def _say_score(self, score: float, exact: bool) -> None:
        self.score.set_text(f"{'' if exact else '≈ '}{scored(score)}")
        self.score.classes(replace=tone(score))
