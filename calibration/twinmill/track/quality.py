# SPDX-License-Identifier: Apache-2.0
"""How good a film's poses are, as far as the film itself can tell."""

from dataclasses import asdict, dataclass

import numpy as np

from twinmill.track.floor import View
from twinmill.track.paths import RobotPath

THIRD = np.array([-1.0, 3.0, -3.0, 1.0])  # takes out a place, a speed and an acceleration
TO_SIGMA = 1.4826 / np.sqrt(np.sum(THIRD**2))  # from the median size of such a difference
EVEN = 0.3  # frames are evenly spaced if their steps differ by less than this share
CORNERS_PX = 0.5  # a sharp tag's miss by 0.1 to 0.3
SPEED_MPS, WINDOW_S = 0.3, 0.5
LEVER_M = 0.126  # half wheelbase and half track of a TurboPi


@dataclass(frozen=True)
class RobotQuality:
    """One robot.

    Attributes:
        robot_id: its number.
        frames, lost_share: frames of the film, and the share without it.
        longest_gap_s: without it.
        odd: sightings left out.
        error_px: RMS miss of its corners.
        position_noise_m, heading_noise_rad: standard deviation from one frame to the next.
        corner_position_m, corner_heading_rad: what the corners' misses alone would make.
    """

    robot_id: int
    frames: int
    lost_share: float
    longest_gap_s: float
    odd: int
    error_px: float
    position_noise_m: float
    heading_noise_rad: float
    corner_position_m: float
    corner_heading_rad: float


@dataclass(frozen=True)
class Quality:
    """A film.

    Attributes:
        robots: each.
        rate_hz: of the frames, the median.
        floor_error_px: RMS miss of the floor's points.
        camera_height_m, camera_tilt_rad: as found from them.
        weakest_wheel: smallest loss of one wheel's speed that one window shows, as a share.
    """

    robots: list[RobotQuality]
    rate_hz: float
    floor_error_px: float
    camera_height_m: float
    camera_tilt_rad: float
    weakest_wheel: float

    def to_json(self) -> dict:
        """All of it, warnings, and the sentence."""
        return {**asdict(self), "warnings": self.warnings, "meaning": self.sentence}

    @property
    def warnings(self) -> list[str]:
        """What makes poses wrong that look quiet."""
        worst_px = max((r.error_px for r in self.robots if np.isfinite(r.error_px)), default=0.0)
        if worst_px < CORNERS_PX:
            return []
        return [
            f"the tags' corners miss by {worst_px:.2f} px: the lens file or the height does not "
            "fit, or the size; poses may be off by centimetres."
        ]

    @property
    def sentence(self) -> str:
        """What it means for a diagnosis."""
        if not np.isfinite(self.weakest_wheel):
            return "Too few frames follow one another to tell how noisy the poses are."
        words = (
            f"One pair of poses {WINDOW_S:g} s apart shows a wheel that is weaker by "
            f"{100 * self.weakest_wheel:.1f} % (TurboPi's wheels at {SPEED_MPS:g} m/s, three "
            "standard errors of the heading); a log has hundreds of pairs."
        )
        lost = max(robot.lost_share for robot in self.robots)
        if lost > 0.2:
            words += f" Up to {100 * lost:.0f} % of a robot's frames are lost: mend light or view."
        if self.rate_hz < 20:
            words += f" {self.rate_hz:.0f} Hz hide what lasts less than a tenth of a second."
        return words


def judge(paths: list[RobotPath], view: View, size_m: float) -> Quality:
    """Noise by third differences of neighbouring frames: a smooth drive has next to none.

    What stays the same from frame to frame (floor points measured wrongly, a poor lens) is not in
    it; the floor's error tells of that.
    """
    robots = [_robot(path, size_m) for path in paths]
    # Corners that are off alike for a while are no noise from frame to frame, but an error.
    heading = np.array([max(r.corner_heading_rad, r.heading_noise_rad) for r in robots])
    noise_rad = float(np.nanmedian(heading)) if np.isfinite(heading).any() else np.nan
    # A wheel of four that loses the share g turns a robot at speed v by g v / (4 lever).
    turn_rad = SPEED_MPS * WINDOW_S / (4 * LEVER_M)
    return Quality(
        robots,
        float(1 / np.median(np.diff(paths[0].t_s))) if len(paths[0].t_s) > 1 else np.nan,
        view.error_px,
        float(view.position_m[2]),
        view.tilt_rad,
        3 * np.sqrt(2) * noise_rad / turn_rad,
    )


def _robot(path: RobotPath, size_m: float) -> RobotQuality:
    valid = path.valid
    x, y = (_noise(path.t_s, path.pose[:, k]) for k in (0, 1))
    heading = path.pose[:, 2].copy()
    heading[valid] = np.unwrap(heading[valid])
    rms_px = float(np.sqrt(np.mean(path.error_px[valid] ** 2))) if valid.any() else np.nan
    # Eight coordinates less three that were fitted make the misses; four corners make the place.
    scale = np.median(path.scale_px_per_m[valid]) if valid.any() else np.nan
    one_m = rms_px / np.sqrt(2) * np.sqrt(8 / 5) / scale
    return RobotQuality(
        path.robot_id,
        len(valid),
        float(1 - valid.mean()),
        _longest_gap_s(path),
        path.odd,
        rms_px,
        float(np.sqrt((x**2 + y**2) / 2)),
        _noise(path.t_s, heading),
        float(one_m / 2),
        float(one_m / (np.sqrt(2) * size_m)),
    )


def _noise(t_s: np.ndarray, values: np.ndarray) -> float:
    """Standard deviation of white noise on (F,) values; NaN from fewer than ten quadruples."""
    if len(values) < 13:
        return np.nan
    third = np.convolve(values, THIRD[::-1], "valid")
    steps = np.lib.stride_tricks.sliding_window_view(np.diff(t_s), 3)
    third = third[np.ptp(steps, axis=1) < EVEN * np.median(np.diff(t_s))]
    third = third[np.isfinite(third)]
    return float(np.median(np.abs(third)) * TO_SIGMA) if len(third) >= 10 else np.nan


def _longest_gap_s(path: RobotPath) -> float:
    """From the last sight to the next; the film's ends count as sights."""
    ends = [path.t_s[0], *path.t_s[path.valid], path.t_s[-1]]
    gap_s = float(np.max(np.diff(ends)))
    return gap_s if not path.valid.all() else 0.0
