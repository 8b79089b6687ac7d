# SPDX-License-Identifier: Apache-2.0
"""Compares a model with a steady-state table."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.data.steady_table import SteadyTable
from twinmill.predict.regimes import Regime
from twinmill.predict.steady_states import SteadyStates

SLOW, FAST = 0.45, 0.75  # duty below and above which an input counts as slow and fast
SPOT_MPS = 0.05
ON_BENCH = "wheels"  # the group of what a bench test has


@dataclass(frozen=True)
class SteadyFloor:
    """Errors of a table are given over their floor: the scatter of runs, or with that of robots."""

    kind: str


@dataclass(frozen=True)
class SteadyComparison:
    """One robot of one table.

    Attributes:
        modelled: table and model.
        predicted, errors: (U, C), as the channels of `modelled`.
        floor: where it comes from.
        where: regimes.
    """

    modelled: SteadyStates
    predicted: np.ndarray
    errors: np.ndarray
    floor: SteadyFloor
    where: list[Regime]

    @property
    def measurement(self) -> SteadyTable:
        """The robot's rows of the table."""
        return self.modelled.measurement

    @property
    def robot_id(self) -> int:
        """Its number."""
        return self.measurement.robot_id

    @property
    def model(self) -> native.Model:
        """Model of this robot, its own parameters included."""
        return self.modelled.model

    @property
    def ratios(self) -> np.ndarray:
        """(U, C) errors over floor."""
        return self.modelled.ratios()

    @property
    def score(self) -> float:
        """RMS over channels of error over floor, of this robot alone."""
        return self.modelled.score(self.model)

    @property
    def size(self) -> int:
        """How many values were predicted."""
        return int(np.isfinite(self.errors).sum())

    def error_rows(self) -> list[dict[str, Any]]:
        """errors[] of the interface; a ratio is the RMS of each input's own."""
        rows = []
        for c, (channel, unit) in enumerate(self.modelled.channels):
            known = np.isfinite(self.errors[:, c])
            if known.any():
                parts = (self.errors, self.modelled.floor(), self.ratios)
                values = [float(np.sqrt(np.mean(part[known, c] ** 2))) for part in parts]
                rows.append(
                    {
                        "channel": channel,
                        "unit": unit,
                        "horizon_s": None,
                        **dict(zip(("rms", "floor", "ratio"), values, strict=True)),
                    }
                )
        return rows

    def cells(self) -> list[dict[str, Any]]:
        """One entry per input, in the vendor's convention; a spread is relative, over robots.

        Of a bench test by duties, with the speed of each wheel.
        """
        sheet = self.measurement
        keys = ("measured", "predicted", "floor", "ratio")
        entries = []
        for u, inputs in enumerate(sheet.inputs):
            entry = {
                **dict(zip(sheet.input_names, inputs.tolist(), strict=True)),
                "runs": int(sheet.runs[u]),
            }
            if not sheet.of_wheels:
                entry["side_stands_still"] = bool(sheet.still[u])
                entry["standing_side_predicted_mps"] = float(self.predicted[u, 2])
            for c, channel in enumerate(sheet.columns):
                values = (
                    sheet.value[u, c],
                    self.predicted[u, c],
                    sheet.floor[u, c],
                    self.ratios[u, c],
                )
                entry[channel] = {
                    **{k: float(v) for k, v in zip(keys, values, strict=True)},
                    "spread": float(sheet.cell_spread[u, c]),
                }
            entries.append(entry)
        return entries

    def to_json(self) -> dict[str, Any]:
        """One entry of robots[]."""
        sheet = self.measurement
        return {
            "robot_id": sheet.robot_id,
            "log": sheet.log_name,
            "score": self.score,
            "floor_kind": self.floor.kind,
            "noise": None,
            "errors": self.error_rows(),
            "where": [r.to_json() for r in self.where],
            "time_offset_s": None,
            "spread": {
                name: {"within_robot": s.runs, "between_robots": s.robots}
                for (name, _), s in zip(self.modelled.channels, sheet.spread, strict=False)
            },
            "cells": self.cells(),
        }


def compare_steady(states: SteadyStates) -> SteadyComparison:
    """Compares one robot of a table."""
    kind = "repeat" if states.measurement.fold is None else "spread"
    return SteadyComparison(
        states,
        states.predicted(),
        states.errors(),
        SteadyFloor(kind),
        _where(states, states.ratios()),
    )


def _where(states: SteadyStates, ratios: np.ndarray) -> list[Regime]:
    """By path and by the smallest duty, the worst first; wheels on a bench have no path."""
    count = np.isfinite(ratios).sum(axis=1)
    squares = np.nansum(ratios**2, axis=1)
    regimes = [
        Regime(
            group,
            name,
            float(squares[mask].sum() / max(squares.sum(), 1e-12)),
            float(np.sqrt(squares[mask].sum() / count[mask].sum())),
            int(count[mask].sum()),
        )
        for group, name, mask in _masks(states)
        if count[mask].sum()
    ]
    return sorted(regimes, key=lambda r: (r.group != "path", -r.ratio))


def _masks(states: SteadyStates) -> Iterator[tuple[str, str, np.ndarray]]:
    duty = np.abs(states.commands)
    if states.measurement.of_wheels:
        of, size = ON_BENCH, duty.max(axis=1)
    else:
        yield from _by_path(states.measurement)
        of, size = "slowest wheel", duty.min(axis=1)
    yield of, f"duty below {SLOW:.0%}", size < SLOW
    yield of, f"duty {SLOW:.0%} to {FAST:.0%}", (size >= SLOW) & (size <= FAST)
    yield of, f"duty above {FAST:.0%}", size > FAST


def _by_path(sheet: SteadyTable) -> Iterator[tuple[str, str, np.ndarray]]:
    turns = sheet.inputs[:, 2] != 0
    along = np.isin(sheet.inputs[:, 1] % 180, (90,))
    spot = turns & (np.nan_to_num(sheet.value[:, 0], nan=1.0) < SPOT_MPS)
    yield "path", "straight, forward or back", ~turns & along
    yield "path", "straight, sideways or diagonal", ~turns & ~along
    yield "path", "on the spot", spot
    yield "path", "in a circle", turns & ~spot
