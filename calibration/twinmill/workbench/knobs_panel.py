# SPDX-License-Identifier: Apache-2.0
"""The panel of knobs: each quantity as a slider with its interval; hold, free, fit."""

from nicegui import events, ui

from twinmill.workbench.knobs import Knob
from twinmill.workbench.panel import PageActions, markup


class KnobsPanel:
    """Draws the knobs of the model where the tree stands."""

    def __init__(self, page: PageActions) -> None:
        self.page, self.bench = page, page.bench
        self._rows: dict[str, _Row] = {}
        with ui.element("div").classes("buttons"):
            self.fit = ui.button("Fit", on_click=lambda: page.start("fit"))
            self.fit.props('dense unelevated no-caps padding="2px 16px" data-testid="fit"')
            self.fit.tooltip("Fits all quantities that are free, as the command twinmill fit does")
            ui.label("Locked ones are held.").classes("soft")
        self.body = ui.element("div").classes("stack")

    def draw(self) -> None:
        """New rows only where the quantities are others; else new values."""
        knobs = self.bench.session.knobs() if self.bench.ready else []
        self.fit.set_enabled(bool(knobs))
        if [k.name for k in knobs] == list(self._rows):
            for knob in knobs:
                self._rows[knob.name].show(knob)
            return
        self.body.clear()
        self._rows.clear()
        with self.body:
            self._groups([k for k in knobs if k.fitted])
            if rest := [k for k in knobs if not k.fitted]:
                with ui.expansion("Not told by these logs").props("dense").style("width: 100%"):
                    self._groups(rest)

    def _groups(self, knobs: list[Knob]) -> None:
        group = None
        for knob in knobs:
            if knob.group != group:
                group = knob.group
                markup("<div class=group>{}</div>", group)
            self._rows[knob.name] = _Row(knob, self)


class _Row(ui.element, component="static/knob.js"):
    """One knob."""

    def __init__(self, knob: Knob, panel: KnobsPanel) -> None:
        super().__init__()
        self.panel = panel
        self.props(f'data-testid="knob-{knob.name}"')
        self.on("keep", self._keep)
        self.on("hold", self._toggle)
        self.show(knob)

    def show(self, knob: Knob) -> None:
        """Another value, reach or interval."""
        self.knob = knob
        self.props.update(
            name=knob.name,
            label=knob.label,
            words=f"{knob.name}: {knob.words}" if knob.words else knob.name,
            unit="" if knob.unit == "1" else knob.unit,
            value=knob.value,
            low=knob.low,
            high=knob.high,
            least=knob.least,
            most=knob.most,
            step=knob.step,
            interval=knob.interval,
            fitted=knob.fitted,
            held=knob.name in self.panel.bench.session.held,
            drawn=self.props.get("drawn", 0) + 1,
        )
        self.update()

    def _toggle(self) -> None:
        """Holds what was free, frees what was held."""
        held = self.panel.bench.session.held
        held ^= {self.knob.name}
        self.props["held"] = self.knob.name in held
        self.update()

    async def _keep(self, event: events.GenericEventArguments) -> None:
        """Keeps the value that a hand let go, or typed."""
        knob, asked = self.knob, float(event.args)
        value = min(max(asked, knob.least), knob.most)
        if value != asked:
            bounds = f"{knob.least:g} to {knob.most:g}"
            ui.notify(f"{knob.name} = {asked:g}: must be within {bounds}; {value:g} was taken.")
        await self.panel.page.keep(knob.name, value)
