# SPDX-License-Identifier: Apache-2.0
"""How good a film's poses are, as far as the film itself can tell."""

from dataclasses import asdict, dataclass

import numpy as np

from twinmill.arguments import option
from twinmill.track.detect import other_drawing
from twinmill.track.floor import View
from twinmill.track.paths import RobotPath, Tags

THIRD = np.array([-1.0, 3.0, -3.0, 1.0])  # takes out a place, a speed and an acceleration
TO_SIGMA = 1.4826 / np.sqrt(np.sum(THIRD**2))  # from the median size of such a difference
EVEN = 0.3  # frames are evenly spaced if their steps differ by less than this share
CORNERS_PX = 0.5  # a sharp tag's miss by 0.1 to 0.3
SPEED_MPS, WINDOW_S = 0.3, 0.5
GRID, RIM = 9, 0.05  # places in the picture at which noise is told, within this share of its edge
MOVED_M = 0.03  # in WINDOW_S: more than a robot that stands seems to
BACKWARDS, ALONG = 0.9, np.cos(np.radians(30))  # share of its way; of a step, nearly along its axis
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
        backward_share: of the windows in which it moved, those in which it did against its heading.
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
    backward_share: float


@dataclass(frozen=True)
class Quality:
    """A film.

    Attributes:
        robots: each.
        rate_hz: of the frames, the median.
        floor_error_px: RMS miss of the floor's points.
        camera_height_m, camera_tilt_rad: as found from them.
        position_over_floor_m, heading_over_floor_rad: least and largest standard deviation that the
            corners' misses make, over all that the camera sees.
        weakest_wheel: smallest loss of one wheel's speed that one window shows, as a share.
        family: of the tags.
    """

    robots: list[RobotQuality]
    rate_hz: float
    floor_error_px: float
    camera_height_m: float
    camera_tilt_rad: float
    position_over_floor_m: tuple[float, float]
    heading_over_floor_rad: tuple[float, float]
    weakest_wheel: float
    family: str

    def to_json(self) -> dict:
        """All of it, warnings, and the sentence."""
        return {**asdict(self), "warnings": self.warnings, "meaning": self.sentence}

    @property
    def warnings(self) -> list[str]:
        """Faults that make poses wrong though they look quiet."""
        said = [self._backwards(r.robot_id) for r in self.robots if r.backward_share > BACKWARDS]
        worst_px = max((r.error_px for r in self.robots if np.isfinite(r.error_px)), default=0.0)
        if worst_px >= CORNERS_PX:
            said.append(
                f"the tags' corners miss by {worst_px:.2f} px: the lens file or the height does "
                "not fit, or the size; poses may be off by centimetres."
            )
        return said

    def _backwards(self, robot_id: int) -> str:
        """Causes of a heading opposite to the motion, and advice."""
        other = other_drawing(self.family)
        drawn = other and (
            f"if its tag is drawn as {'AprilTag' if other.startswith('tag') else 'OpenCV'} draws "
            f"it, which is upside down against {self.family}, track it with "
            f"{option('family', other)}; "
        )
        return (
            f"robot {robot_id} moves opposite to its heading: {drawn or ''}if its front is the "
            f"tag's lower edge, import with {option('heading_offset_deg', 180, robot_id)}; else it "
            "was "
            "driven backwards."
        )

    @property
    def sentence(self) -> str:
        """Consequence for a diagnosis."""
        if not np.isfinite(self.weakest_wheel):
            return "Too few frames follow one another to tell how noisy the poses are."
        near_m, far_m = (1e3 * m for m in self.position_over_floor_m)
        near_rad, far_rad = np.degrees(self.heading_over_floor_rad)
        words = (
            f"Over the floor noise of {near_m:.2f} to {far_m:.2f} mm and {near_rad:.2f} to "
            f"{far_rad:.2f}° is to be expected. One pair of poses {WINDOW_S:g} s apart shows a "
            f"wheel that is weaker by {100 * self.weakest_wheel:.1f} % (TurboPi's wheels at "
            f"{SPEED_MPS:g} m/s, three standard errors of the heading); a log has hundreds of "
            "pairs."
        )
        lost = max(robot.lost_share for robot in self.robots)
        if lost > 0.2:
            words += f" Up to {100 * lost:.0f} % of a robot's frames are lost: mend light or view."
        if self.rate_hz < 20:
            words += f" {self.rate_hz:.0f} Hz hide what lasts less than a tenth of a second."
        return words


def judge(paths: list[RobotPath], view: View, tags: Tags) -> Quality:
    """Noise by third differences of neighbouring frames: a smooth drive has next to none.

    What stays the same from frame to frame (floor points measured wrongly, a poor lens) is not in
    it; the floor's error tells of that.
    """
    robots = [_robot(path, tags.size_m) for path in paths]
    seen_px = np.concatenate([path.error_px[path.valid] for path in paths])
    off_px = _of_one(float(np.sqrt(np.mean(seen_px**2)))) if len(seen_px) else np.nan
    scale = _metres_per_px(view, tags.height_m)
    off_m = [off_px * float(end(scale)) for end in (np.nanmin, np.nanmax)]
    # Corners that are off alike for a while are no noise from frame to frame, but an error.
    heading = np.array([max(r.corner_heading_rad, r.heading_noise_rad) for r in robots])
    noise_rad = float(np.nanmedian(heading)) if np.isfinite(heading).any() else np.nan
    # A wheel of four that loses the share g turns a robot at speed v by g v / (4 lever).
    turn_rad = SPEED_MPS * WINDOW_S / (4 * LEVER_M)
    return Quality(
        robots=robots,
        rate_hz=float(1 / np.median(np.diff(paths[0].t_s))) if len(paths[0].t_s) > 1 else np.nan,
        floor_error_px=view.error_px,
        camera_height_m=float(view.position_m[2]),
        camera_tilt_rad=view.tilt_rad,
        position_over_floor_m=tuple(_of_place(m) for m in off_m),
        heading_over_floor_rad=tuple(_of_heading(m, tags.size_m) for m in off_m),
        weakest_wheel=3 * np.sqrt(2) * noise_rad / turn_rad,
        family=tags.family,
    )


def _robot(path: RobotPath, size_m: float) -> RobotQuality:
    valid = path.valid
    x, y = (_noise(path.t_s, path.pose[:, k]) for k in (0, 1))
    heading = path.pose[:, 2].copy()
    heading[valid] = np.unwrap(heading[valid])
    rms_px = float(np.sqrt(np.mean(path.error_px[valid] ** 2))) if valid.any() else np.nan
    scale = np.median(path.scale_px_per_m[valid]) if valid.any() else np.nan
    one_m = _of_one(rms_px) / scale
    return RobotQuality(
        robot_id=path.robot_id,
        frames=len(valid),
        lost_share=float(1 - valid.mean()),
        longest_gap_s=_longest_gap_s(path),
        odd=path.odd,
        error_px=rms_px,
        position_noise_m=float(np.sqrt((x**2 + y**2) / 2)),
        heading_noise_rad=_noise(path.t_s, heading),
        corner_position_m=_of_place(one_m),
        corner_heading_rad=_of_heading(one_m, size_m),
        backward_share=_backward_share(path.t_s[valid], path.pose[valid]),
    )


def _backward_share(t_s: np.ndarray, pose: np.ndarray) -> float:
    """Share of windows with motion in which (N, 3) poses move against their heading; 0 of none."""
    end = np.searchsorted(t_s, t_s + WINDOW_S)
    begin = np.flatnonzero(end < len(t_s))
    end = end[begin]
    step = (pose[end, :2] - pose[begin, :2]) @ [1, 1j]
    ahead = np.real(step * np.exp(-1j * pose[(begin + end) // 2, 2]))
    moved = np.abs(step) > MOVED_M
    return float(np.mean(ahead[moved] < -ALONG * np.abs(step[moved]))) if moved.any() else 0.0


def _of_one(rms_px: float) -> float:
    """Standard deviation of one coordinate of a corner from the RMS miss of corners.

    Eight coordinates less three that were fitted make the misses.
    """
    return rms_px / np.sqrt(2) * np.sqrt(8 / 5)


def _of_place(one_m: float) -> float:
    """Standard deviation of a tag's place from that of a corner's coordinate: the mean of four."""
    return float(one_m / 2)


def _of_heading(one_m: float, size_m: float) -> float:
    """That of its heading, rad: four corners, each half a diagonal away."""
    return float(one_m / (np.sqrt(2) * size_m))


def _metres_per_px(view: View, height_m: float) -> np.ndarray:
    """(GRID^2,) over the picture, on the plane of the tags; NaN where it does not see that."""
    share = np.linspace(RIM, 1 - RIM, GRID)
    u, v = np.meshgrid(*(share * side for side in view.camera.size_px))
    pixels = np.column_stack([u.ravel(), v.ravel()])
    here, right, below = (
        view.on_plane(pixels + step, height_m) for step in ([0, 0], [1, 0], [0, 1])
    )
    (a, b), (c, d) = (right - here).T, (below - here).T
    return np.sqrt(np.abs(a * d - b * c))


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
