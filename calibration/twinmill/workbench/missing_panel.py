# SPDX-License-Identifier: Apache-2.0
"""The panel of what is missing: the diagnosis, its findings, and buttons to try and to add each."""

from nicegui import ui

from twinmill.diagnosis.fleet import REFIT
from twinmill.fitting.add import OWN_GAINS
from twinmill.inference.answer import LIKELY
from twinmill.model.parameters import catalogue
from twinmill.report.tables import percent
from twinmill.workbench.bench import moves
from twinmill.workbench.panel import PageActions, estimate, markup, scored
from twinmill.workbench.session import beside_label, effect_of
from twinmill.workbench.typeset import typeset

OTHERS = 8  # effects of the ranking that are shown beside the findings


class MissingPanel:
    """Draws the last diagnosis."""

    def __init__(self, page: PageActions) -> None:
        self.page, self.bench = page, page.bench
        self._adding: list[ui.button] = []
        self._trying: dict[str, list[ui.button]] = {}  # by the words of what is drawn beside
        with ui.element("div").classes("buttons"):
            self.button = ui.button("Diagnose", on_click=lambda: page.start("diagnose"))
            self.button.props('dense unelevated no-caps padding="2px 16px" data-testid="diagnose"')
            self.progress = ui.label().classes("soft").style("flex: 1")
        self.bar = ui.linear_progress(show_value=False).props("indeterminate color=blue-9")
        self.failure = ui.label().classes("note wrong").props('data-testid="failure"')
        self.beside = ui.label().classes("note").props('data-testid="beside"')
        self.body = ui.element("div").classes("stack").props('data-testid="findings"')
        self.draw_progress()
        self.draw_beside()

    def draw_progress(self) -> None:
        """Shows the work under way, or the reason why there is none."""
        doing, ready = self.bench.doing, self.bench.ready
        self.button.set_visibility(doing is None)
        self.button.set_enabled(ready)
        self.bar.set_visibility(doing is not None)
        self.progress.set_text(self.bench.progress if doing else "")
        self.failure.set_text(self.bench.failure)
        self.failure.set_visibility(bool(self.bench.failure))
        for button in self._adding:
            button.set_enabled(ready and doing is None)

    def draw_beside(self) -> None:
        """Shows, in one sentence, the change by an effect that is tried."""
        beside = self.bench.session.beside
        for label, buttons in self._trying.items():
            on = beside is not None and beside.label == label
            for button in buttons:
                button.set_text("Hide" if on else "Show")
        self.beside.set_visibility(beside is not None and beside.label.startswith("with "))
        if self.beside.visible:
            score = scored(self.bench.session.score_beside(self.bench.picked))
            self.beside.set_text(f"Drawn in blue: {beside.label}, score ≈ {score}. Not added yet.")

    def draw(self) -> None:
        """Draws the panel anew from the session's diagnosis."""
        self.body.clear()
        self._adding.clear()
        self._trying.clear()
        found = self.bench.session.diagnosis
        with self.body:
            for note in self.bench.session.notes:
                _card("wrong", "{}", note)
            if found is None:
                ui.label(
                    "Diagnose compares all effects of the catalogue, alone and together, and "
                    "causes without a name."
                ).classes("soft")
                return
            self._said(found)
            if found["probability"]["stale"] > LIKELY:
                self._stale(found["probability"]["stale"])
            for finding in found["findings"]:
                self._finding(finding)
            self._rest(found)
            self._others(found)
        self.draw_progress()
        self.draw_beside()

    def _said(self, found: dict) -> None:
        tree = self.bench.session.tree
        of = tree.file_name(found["of"])
        stale = "" if found["of"] == tree.current.number else f" This was said of {of}."
        _card(
            "said",
            '<b>{}</b><div class="soft">{}</div>',
            found["sentence"],
            stale,
        )

    def _stale(self, probability: float) -> None:
        card = ui.element("div").classes("note").props('data-testid="stale"')
        with card, ui.element("div").classes("head"):
            words = "<b>The base's numbers are stale ({})</b>"
            markup(words, percent(probability)).style("flex: 1")
            self._buttons("")

    def _finding(self, finding: dict) -> None:
        effect, share = finding["effect"], finding["share"]
        sure = finding["certainty"] == "sure"
        with ui.element("div").classes("note").props(f'data-testid="finding-{effect}"'):
            with ui.element("div").classes("head"):
                markup("<b>{}</b>", effect).style("flex: 1")
                ui.label(_chance(finding)).classes(f"chip {'good' if sure else 'warn'}")
                self._buttons(effect)
            _told(effect)
            words = "less than 1 %" if share < 0.005 else f"{100 * share:.0f} %"
            markup(
                '<div class=share><i style="width:{}%"></i></div>removes {} of the error',
                f"{100 * share:.1f}",
                words,
            )
            estimates = "; ".join(estimate(p) for p in finding["parameters"])
            ui.label(estimates).classes("soft")
            if finding["group"]:
                self._rivals(finding["group"][1:])

    def _rivals(self, rivals: list[str]) -> None:
        """Effects that these logs cannot distinguish from a finding."""
        ui.label("These logs cannot distinguish it from:").classes("soft").style("margin-top: 6px")
        for rival in rivals:
            with ui.element("div").classes("line"):
                ui.label(rival).style("flex: 1")
                self._buttons(rival)
        button = ui.button("Design a drive that discriminates", on_click=self.page.design)
        button.props('dense flat no-caps padding="0 8px" data-testid="part-them"')
        self._adding.append(button)

    def _buttons(self, effect: str, robot_id: int | None = None) -> None:
        """To see what an effect, or without a name a refit, would change, and to take it in."""
        verb, words = ("add", "Add") if effect else ("fit", "Refit")
        name = effect_of(effect or REFIT, robot_id).replace(" of ", "-")
        if moves(effect):
            button = ui.button("Show", on_click=lambda: self.page.try_beside(effect, robot_id))
            button.props(f'dense flat no-caps padding="0 8px" data-testid="show-{name}"')
            button.tooltip("Draws its effect on the predictions, before it is added")
            self._trying.setdefault(beside_label(effect, robot_id), []).append(button)
        options = {"robot_id": robot_id}
        button = ui.button(words, on_click=lambda: self.page.start(verb, effect, options))
        button.props(f'dense outline no-caps padding="0 12px" data-testid="add-{name}"')
        self._adding.append(button)

    def _rest(self, found: dict) -> None:
        rest = found["rest"]
        if rest["depends_on"]:
            each = [f"{word} ({percent(p)})" for word, p in rest["probability"].items()]
            ui.label(f"What is left depends on {', '.join(each)}.").classes("soft")
        for off in found["robots_off"]:
            self._robot(off)
        for warning in found["warnings"]:
            ui.label(warning).classes("soft").style("margin-top: 6px")

    def _robot(self, off: dict) -> None:
        """One that differs from the others: how, and its own effect to be taken in."""
        effect = OWN_GAINS if off["effect"] == REFIT else off["effect"]
        if effect != OWN_GAINS and (effect not in catalogue() or not moves(effect)):
            _card("wrong", "{}", off["sentence"])
            return
        with ui.element("div").classes("note wrong").props(f'data-testid="off-{off["robot_id"]}"'):
            with ui.element("div").classes("head"):
                markup("<b>{}</b>", off["sentence"]).style("flex: 1")
                self._buttons(effect, off["robot_id"])
            ui.label("; ".join(estimate(p) for p in off["parameters"])).classes("soft")
            for rival in (off.get("group") or ())[1:]:
                with ui.element("div").classes("line"):
                    ui.label(rival).style("flex: 1")
                    self._buttons(rival, off["robot_id"])

    def _others(self, found: dict) -> None:
        """Lists the other effects that were tried, best first."""
        named = {n for f in found["findings"] for n in (f["group"] or [f["effect"]])}
        others = [r for r in found["ranking"] if r["effect"] not in named][:OTHERS]
        if not others:
            return
        with ui.expansion(f"Also tried ({len(others)})").props("dense").style("width: 100%"):
            for r in others:
                with ui.element("div").classes("line"):
                    ui.label(r["effect"]).style("flex: 1")
                    ui.label(percent(r["probability"]))
                    self._buttons(r["effect"])


def _chance(finding: dict) -> str:
    """How certain a finding is, with its probability."""
    return f"{finding['certainty']}, {percent(finding['probability'])}"


def _told(effect: str) -> None:
    """Shows the catalogue's text on an effect."""
    entry = catalogue().get(effect)
    if entry:
        ui.label(entry["summary"])
        markup("{}", typeset(entry["equation"])).classes("eq")


def _card(kind: str, form: str, *values: str) -> None:
    markup(form, *values).classes(f"note {kind}")
