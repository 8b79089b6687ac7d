# SPDX-License-Identifier: Apache-2.0
"""The panel of knobs: each quantity as a slider with its interval; hold, free, fit."""

from nicegui import events, ui

from twinmill.workbench.hands import Hands
from twinmill.workbench.knobs import Knob

THROTTLE_S = 0.03


class KnobsPanel:
    """Draws the knobs of the model where the tree stands."""

    def __init__(self, page: Hands) -> None:
        self.page, self.bench = page, page.bench
        self._rows: dict[str, _Row] = {}
        with ui.element("div").classes("buttons"):
            self.fit = ui.button("Fit", on_click=lambda: page.start("fit"))
            self.fit.props('dense unelevated no-caps padding="2px 16px" data-testid="fit"')
            self.fit.tooltip("Fits all quantities that are free to the logs, as `twinmill fit`")
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
                ui.html(f"<div class=group>{group}</div>", sanitize=False)
            self._rows[knob.name] = _Row(knob, self)

    def toggle(self, name: str) -> None:
        """Holds what was free, frees what was held."""
        self.bench.session.held ^= {name}
        self._rows[name].lock(name in self.bench.session.held)


class _Row:
    """One knob."""

    def __init__(self, knob: Knob, panel: KnobsPanel) -> None:
        self.name, self.panel = knob.name, panel
        self._typing = False
        with ui.element("div").classes("knob").props(f'data-testid="knob-{knob.name}"'):
            with ui.element("div").classes("line"):
                if knob.fitted:
                    self.icon = ui.icon("lock_open").props("role=button tabindex=0")
                    self.icon.props.update({"aria-label": f"Hold {knob.name}"})
                    for event in ("click", "keydown.enter", "keydown.space"):
                        self.icon.on(event, lambda: panel.toggle(knob.name))
                    self.lock(knob.name in panel.bench.session.held)
                label = ui.label(knob.label).classes("what")
                label.props.update(title=f"{knob.name}: {knob.words}" if knob.words else knob.name)
                self.number = ui.number(value=knob.value, format="%.4g").props(
                    "dense borderless hide-bottom-space"
                )
                self.number.on("focus", lambda: self._type(True))
                self.number.on("keydown.enter", self._left).on("blur", self._left)
                ui.label("" if knob.unit == "1" else knob.unit).classes("unit")
            with ui.element("div").classes("reach"):
                self.interval = ui.element("div").classes("interval")
                self.slider = ui.slider(min=knob.low, max=knob.high, step=knob.step)
                self.slider.props("dense thumb-size=14px track-size=3px color=blue-9")
                self.slider.on("update:model-value", self._dragged, throttle=THROTTLE_S)
                self.slider.on("change", lambda: panel.page.keep())
        self.show(knob)

    def show(self, knob: Knob) -> None:
        """Another value, reach or interval."""
        self.knob = knob
        self.slider.props.update({"min": knob.low, "max": knob.high, "step": knob.step})
        self.slider.set_value(knob.value)
        if not self._typing:  # what is half typed is not taken away
            self.number.set_value(float(f"{knob.value:.6g}"))
        self.interval.set_visibility(knob.interval is not None)
        if knob.interval:
            wide = (knob.high - knob.low) or 1.0
            ends = [min(max((e - knob.low) / wide, 0), 1) for e in knob.interval]
            left, width = 100 * ends[0], max(100 * (ends[1] - ends[0]), 0.8)
            self.interval.style(f"left: {left:.2f}%; width: {width:.2f}%")

    def lock(self, held: bool) -> None:
        """Shows whether it is held."""
        self.icon.props(f"name={'lock' if held else 'lock_open'} aria-pressed={str(held).lower()}")
        self.icon.classes(replace="lock held" if held else "lock")

    def _dragged(self, event: events.GenericEventArguments) -> None:
        value = float(event.args)
        self.number.set_value(float(f"{value:.6g}"))
        self.panel.page.drag(self.name, value)

    def _type(self, typing: bool) -> None:
        self._typing = typing

    async def _left(self) -> None:
        self._type(False)
        await self._typed()

    async def _typed(self) -> None:
        known, value = float(f"{self.knob.value:.6g}"), self.number.value
        if value is None or value == known:
            self.number.set_value(known)
            return
        asked, knob = float(value), self.knob
        value = min(max(asked, knob.least), knob.most)
        if value != asked:
            bounds = f"{knob.least:g} to {knob.most:g}"
            ui.notify(f"{knob.name} = {asked:g}: must be within {bounds}; {value:g} was taken.")
        self.number.set_value(float(f"{value:.6g}"))
        self.panel.page.drag(self.name, value)
        await self.panel.page.keep()
