# SPDX-License-Identifier: Apache-2.0
"""The panel of regimes: where the model fails; a click marks the moments in every view."""

import json

from nicegui import events, ui

from twinmill.fitting.compare import GOOD, MISSING
from twinmill.predict.regimes import Regime
from twinmill.workbench.panel import PageActions, scored

ROW_PX = 21
TONES = ("#009e73", "#e69f00", "#d55e00")  # good, warn, bad
LEAST = 0.2  # where the axis begins at most: what is far below the noise is not looked for
BEFORE_S = 0.5  # the worst moment is shown from so long before it


class FailsPanel:
    """Error over noise floor by what the picked robot was doing."""

    def __init__(self, page: PageActions) -> None:
        self.page, self.bench = page, page.bench
        self._regimes: list[Regime] = []
        ui.label(
            "Error over noise, half a second ahead, by what the robot was doing. Click a bar: its "
            "moments are marked in all views."
        ).classes("soft")
        self.choice = ui.select([], label="or choose one", on_change=self._chosen)
        self.choice.props('dense outlined options-dense data-testid="regime"').style("width: 100%")
        self.chart = ui.echart({}, on_point_click=self._clicked).props('data-testid="regimes"')

    def draw(self) -> None:
        """The picked robot's."""
        session = self.bench.session
        if not self.bench.ready:
            return
        self._regimes = session.regimes(self.bench.picked)[::-1]
        self.choice.set_options([_name(r) for r in self._regimes[::-1]], value=None)
        self.chart.options.clear()
        self.chart.options.update(_chart(self._regimes))
        self.chart.style(f"height: {60 + ROW_PX * len(self._regimes)}px")
        self.chart.update()

    def _clicked(self, event: events.EChartPointClickEventArguments) -> None:
        self.mark(self._regimes[event.data_index])

    def _chosen(self, event: events.ValueChangeEventArguments) -> None:
        if event.value is not None:
            self.mark(next(r for r in self._regimes if _name(r) == event.value))

    def mark(self, regime: Regime) -> None:
        """Its moments, and the cursor before the worst."""
        times, worst = self.bench.session.moments(self.bench.picked, regime.group, regime.regime)
        why = json.dumps(_name(regime))
        moments = json.dumps([round(float(t), 3) for t in times])
        self.page.javascript(f"twinmill.mark({moments}, {worst - BEFORE_S:.3f}, {why})")


def _name(regime: Regime) -> str:
    return f"{regime.group}: {regime.regime}"


def _chart(regimes: list[Regime]) -> dict:
    """Bars on a scale of factors, the worst of each group on top."""
    low = max(LEAST, min([0.5, *(0.8 * r.ratio for r in regimes)]))
    bars = [
        {
            "value": round(max(r.ratio, low), 4),
            "itemStyle": {"color": TONES[(r.ratio > GOOD) + (r.ratio > MISSING)]},
            "label": {"formatter": f"{scored(r.ratio)}  ({100 * r.share:.0f} %)"},
        }
        for r in regimes
    ]
    return {
        "animation": False,
        "grid": {"left": 128, "right": 84, "top": 6, "bottom": 34},
        "xAxis": {
            "type": "log",
            "min": low,
            "startValue": low,
            "name": "error over noise (share of all error)",
            "nameLocation": "middle",
            "nameGap": 22,
            "splitLine": {"lineStyle": {"color": "#eef2f4"}},
        },
        "yAxis": {
            "type": "category",
            "data": [_name(r) for r in regimes],
            "axisTick": {"show": False},
            "axisLabel": {"fontSize": 11, "interval": 0},
        },
        "series": [
            {
                "type": "bar",
                "data": bars,
                "barWidth": "66%",
                "cursor": "pointer",
                "label": {
                    "show": True,
                    "position": "right",
                    "fontSize": 11,
                    "backgroundColor": "#ffffff",
                },
                "markLine": {
                    "silent": True,
                    "z": 1,  # below the words
                    "symbol": "none",
                    "label": {"show": False},
                    "lineStyle": {"color": "#3c3c3c", "type": "dashed"},
                    "data": [{"xAxis": 1}],
                },
            }
        ],
    }
