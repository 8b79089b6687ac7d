# SPDX-License-Identifier: Apache-2.0
"""Measured velocities beside lagged commands, without any model of the robot.

Both are averaged over the same window, so that neither noise nor slow cameras matter: the slope of
a least-squares line over [-h, h] is the mean velocity under the weight 3 (h^2 - s^2) / (4 h^3).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from twinmill.data.track import Track, local_line
from twinmill.filters import filtered

GRID_S = 0.02
HALF_S = 0.15  # of the window; three poses at least
THIN_S = 0.06
MOST = 3000  # times: more tell no mistake better
LAGS_S = (0.02, 0.06, 0.15, 0.35)
EARLY_S, LATE_S, STEP_S = -0.6, 1.2, 0.06  # poses against commands: clock, delay
BLOCK_S = 3.0
KEPT_BYTES = 4_000_000  # four lags of a log of 200 s
SHAPES = 3  # of a command: its root, itself, its square, all with its sign

Felt = tuple[float, np.ndarray]  # begin of the grid, s; (G, SHAPES, 4)


@dataclass(frozen=True)
class Motion:
    """Velocities of one robot at K times, and its commands as they were felt then.

    Attributes:
        t_s: (K,) capture's clock.
        world_mps: (K,) complex, x + i y.
        turn_radps: (K,) zero where the heading was not recorded.
        heading_rad: (K,) zero where the heading was not recorded.
        has_heading: whether it was.
        grid_s, shapes: (G,) and (G, SHAPES, 4) commands on an even grid, robot's clock.
        half_s: of the window.
        block_s: length of a stretch.
        led_m: how a turn led the tracked point, where that was taken out, as in `at_axle`.
    """

    t_s: np.ndarray
    world_mps: np.ndarray
    turn_radps: np.ndarray
    heading_rad: np.ndarray
    has_heading: bool
    grid_s: np.ndarray
    shapes: np.ndarray
    half_s: float
    block_s: float = BLOCK_S
    led_m: complex = 0j

    @classmethod
    def of(cls, track: Track) -> "Motion":
        """Speeds and headings of a track, from straight lines through its nearby poses."""
        half_s = max(HALF_S, 1.5 * track.timing.pose_period_s)
        value, slope = local_line(track.pose_t_s, track.pose, track.segment, half_s)
        heading_rad = value[:, 2]
        if not track.has_heading:
            slope[:, 2], heading_rad = 0, 0 * slope[:, 0]
        known = np.flatnonzero(np.isfinite(slope).all(axis=1))
        every = max(1, round(THIN_S / track.timing.pose_period_s), len(known) // MOST)
        known = known[::every]
        first = min(track.command_t_s[0], track.pose_t_s[0]) - LATE_S - 1
        last = max(track.command_t_s[-1], track.pose_t_s[-1]) + 1
        grid_s = np.arange(first, last, GRID_S)
        motion = cls(
            t_s=track.pose_t_s[known],
            world_mps=slope[known, 0] + 1j * slope[known, 1],
            turn_radps=slope[known, 2],
            heading_rad=heading_rad[known],
            has_heading=track.has_heading,
            grid_s=grid_s,
            shapes=_shapes(track, grid_s),
            half_s=half_s,
        )
        return motion.in_stretches(BLOCK_S)

    def in_stretches(self, block_s: float) -> "Motion":
        """Motion averaged over a length; over a longer one where that makes more than MOST."""
        span_s = float(np.ptp(self.t_s)) if len(self.t_s) else 0.0
        return replace(self, block_s=max(block_s, span_s / MOST))

    @cached_property
    def block(self) -> np.ndarray:
        """(K,) number of the stretch that a time lies in."""
        return ((self.t_s - self.t_s[0]) // self.block_s).astype(int)

    def body_mps(self, heading_sign: int = 1, mirrored: bool = False) -> np.ndarray:
        """(K,) complex, forward + i left, as the poses say or as they would say if mended.

        Args:
            heading_sign: -1 if headings are to be taken clockwise.
            mirrored: positions are to be mirrored (y negative).
        """
        world = np.conj(self.world_mps) if mirrored else self.world_mps
        return world * np.exp(-1j * heading_sign * self.heading_rad)

    def mended(self, heading_sign: int, mirrored: bool, turned_rad: float) -> "Motion":
        """Motion with poses read otherwise, as in `body_mps`; front `turned_rad` to the left."""
        return replace(
            self,
            world_mps=np.conj(self.world_mps) if mirrored else self.world_mps,
            heading_rad=heading_sign * self.heading_rad + turned_rad,
            turn_radps=heading_sign * self.turn_radps,
        )

    def at_axle(self, led_m: complex, heading_sign: int = 1, mirrored: bool = False) -> "Motion":
        """Motion of the point that the robot turns about.

        Args:
            led_m: how a turn to the left leads the tracked point: ahead + i left, m per rad.
            heading_sign: as in `body_mps`, in whose axes that is told.
            mirrored: likewise.
        """
        led = led_m * self.turn_radps * np.exp(1j * heading_sign * self.heading_rad)
        world_mps = self.world_mps - (np.conj(led) if mirrored else led)
        return replace(self, world_mps=world_mps, led_m=led_m)

    def told_in_room(self) -> "Motion":
        """Motion if the first two columns were velocities along the room's axes."""
        heading_rad = np.interp(self.grid_s, self.t_s, np.unwrap(self.heading_rad))
        linear = self.shapes[:, 1].copy()
        along = (linear[:, 0] + 1j * linear[:, 1]) * np.exp(-1j * heading_rad)
        linear[:, 0], linear[:, 1] = along.real, along.imag
        return replace(self, shapes=_powers(linear))

    @property
    def ahead_s(self) -> float:
        """By which what is felt comes too soon: an even window has its middle between two steps."""
        return GRID_S / 2 * (len(self._window) % 2 == 0)

    @property
    def _window(self) -> np.ndarray:
        s = np.arange(-self.half_s, self.half_s + GRID_S / 2, GRID_S)
        weight = np.maximum(self.half_s**2 - s**2, 0)
        return weight / weight.sum()

    def felt(self, lag_s: float) -> Felt:
        """Commands through a first-order lag, averaged over the window."""
        made = self._kept.get(lag_s)
        if made is None:
            made = self._felt(lag_s)
            if (1 + len(self._kept)) * made.nbytes < KEPT_BYTES:
                self._kept[lag_s] = made
        return float(self.grid_s[0]), made

    @cached_property
    def _kept(self) -> dict[float, np.ndarray]:
        """Cache of sums at lags that were asked for, kept for logs that are not long."""
        return {}

    def _felt(self, lag_s: float) -> np.ndarray:
        keep = np.exp(-GRID_S / lag_s)
        found = np.zeros_like(self.shapes)
        for at in np.ndindex(found.shape[1:]):  # one at a time, as a log may be long
            told = self.shapes[:, *at]
            if told.any():
                lagged = filtered([1 - keep], [1, -keep], told)
                found[:, *at] = _averaged(lagged, self._window)
        return found

    def at(self, felt: Felt, late_s: float) -> np.ndarray:
        """(K, ...) of what was felt `late_s` before each pose."""
        begin_s, values = felt
        place = np.clip(self.places(begin_s) - late_s / GRID_S, 0, len(values) - 1.001)
        k = place.astype(int)
        part = (place - k).reshape(-1, *[1] * (values.ndim - 1))
        return values[k] * (1 - part) + values[k + 1] * part

    def places(self, begin_s: float, rate: float = 0.0) -> np.ndarray:
        """(K,) steps from the begin of a grid to each pose; `rate` of the clocks, s/s."""
        return (self.t_s - rate * (self.t_s - self.t_s[0]) - begin_s) / GRID_S


def _averaged(signal: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(G,) weighted means around each time; ends go on as they are.

    `scipy.ndimage` does the same, and takes a tenth of a second to import.
    """
    before = (len(weight) - 1) // 2
    around = np.pad(signal, (before, len(weight) - 1 - before), "edge")
    return sum(w * around[k : k + len(signal)] for k, w in enumerate(weight))


def _shapes(track: Track, grid_s: np.ndarray) -> np.ndarray:
    """(G, SHAPES, 4) the command in force in each grid step, averaged over the step."""
    knots_s = np.append(track.command_t_s, max(grid_s[-1], track.command_t_s[-1]) + 1)
    place = np.clip(np.searchsorted(knots_s, grid_s, side="right") - 1, 0, len(knots_s) - 2)
    within = np.clip(grid_s - knots_s[place], 0, None)
    before = grid_s < knots_s[0]
    found = np.zeros((len(grid_s), SHAPES, 4))
    told = _powers(track.command)
    for at in np.ndindex(SHAPES, 4):  # one at a time, as a log may be long
        held = told[:, *at]
        area = np.concatenate([[0.0], np.cumsum(held * np.diff(knots_s))])
        at_grid = area[place] + held[place] * within
        at_grid[before] = 0
        found[:, *at] = np.diff(at_grid, prepend=0.0) / GRID_S
    return found


def _powers(command: np.ndarray) -> np.ndarray:
    """(M, SHAPES, 4) of (M, 4): its root, itself, its square, as large as the largest command."""
    top = np.abs(command).max()
    unit = command / (top or 1)
    size, sign = np.abs(unit), np.sign(unit)
    return np.stack([sign * np.sqrt(size), unit, sign * size**2], axis=1) * top
