# SPDX-License-Identifier: Apache-2.0
"""Sources of an import and the options for reading them, each with its use."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from twinmill.arguments import option
from twinmill.data.importers.robot_files import WORD
from twinmill.data.importers.series import CommandSeries, PoseSeries
from twinmill.data.log import LogError

Flips = Mapping[int | None, frozenset[str]]  # of all robots, by None; or by robot_id
OfRobots = float | Mapping[int | None, float]  # of all robots; or by robot_id, None for all


@dataclass(frozen=True)
class ImportOptions:
    """How to read the files.

    Attributes:
        robot_id: whose the rows are, for files that do not say.
        robots: robot_id by name: of a rigid body, in a table's column robot_id, as a word in the
            name of a robot's own table or in a bag's topics.
        rename: column in a plain CSV file to column as we name it, or with another unit; or one of
            ours, whatever the file calls it, to another one of ours.
        own_renames: the same in the rows of single robots, by number.
        exchange: pairs of robots of which each has the other's poses; one after the other.
        mapping: file that says which column is what, in place of `rename`.
        flips: our columns that are to change their sign.
        up: "x", "y" or "z", the axis that the poses call up; None: Motive's y, z of all others.
        pose_shift_s: added to the stamps of poses; of a robot that is named, to that of all.
        pose_clock_ppm: by which the poses' clock gains on the commands', taken out; likewise.
        heading_offset_rad: from the tracked body's x axis to the robot's front, left positive;
            likewise.
        path_heading: take the heading from the path, where positions alone were recorded.
        same_clock: one clock stamped poses and commands: no offset is estimated.
        pose_topics, command_topics: of a ROS bag, one of each for each robot; of a table of
            several topics the one that is meant.
        receive_stamps: of a ROS bag, take the times of receipt, not those in the headers.
        wheelbase_m: of a robot that is told steering angles.
        full_duty: of a ROS bag with duties, the number that stands for full duty.
        wheel_factor: by which wheel speeds are multiplied to be those of the wheels in rad/s.
        command_timeout_s: of a robot that stands once it has heard no command for so long.
        force: replace an output that exists.
    """

    robot_id: int | None = None
    robots: dict[str, int] = field(default_factory=dict)
    rename: dict[str, str] = field(default_factory=dict)
    own_renames: dict[int, dict[str, str]] = field(default_factory=dict)
    exchange: tuple[tuple[int, int], ...] = ()
    mapping: Path | None = None
    flips: Flips = field(default_factory=dict)
    up: str | None = None
    pose_shift_s: OfRobots = 0.0
    pose_clock_ppm: OfRobots = 0.0
    heading_offset_rad: OfRobots = 0.0
    path_heading: bool = False
    same_clock: bool = False
    pose_topics: tuple[str, ...] = ()
    command_topics: tuple[str, ...] = ()
    receive_stamps: bool = False
    wheelbase_m: float | None = None
    full_duty: float | None = None
    wheel_factor: float | None = None
    command_timeout_s: float | None = None
    force: bool = False


@dataclass(frozen=True)
class Sources:
    """Files that a log is made of, as arguments of `import_log`."""

    poses: tuple[Path, ...] = ()
    commands: tuple[Path, ...] = ()
    motive: Path | None = None
    vicon: Path | None = None
    io_tsv: tuple[Path, ...] = ()
    bag: Path | None = None
    detections: Path | None = None

    @property
    def files(self) -> list[Path]:
        """All but a bag, which may be a folder."""
        one = (self.motive, self.vicon, self.detections)
        return [*self.poses, *self.commands, *self.io_tsv, *(path for path in one if path)]

    def names(
        self, options: "ImportOptions", series: Sequence[PoseSeries | CommandSeries]
    ) -> set[str]:
        """Words by which a robot may be called."""
        called = {own.called for own in series} - {""}
        topics = [*options.pose_topics, *options.command_topics] if self.bag else []
        called |= {word for topic in topics for word in topic.replace(":", "/").split("/") if word}
        for paths in (self.poses, self.commands):
            stems = [path.name.split(".")[0] for path in paths] if len(paths) > 1 else []
            called |= {word for stem in stems for word in (stem, *WORD.findall(stem))}
        return called


# Options that not every source has a use for: those that have, and what to do about others.
USES = {
    "mapping": (
        ("poses", "commands"),
        "it says what the columns of tables are; to rename and to flip work with all sources",
    ),
    "pose": (("bag", "poses"), "it names a topic of a bag, or of a table of several topics"),
    "command": (("bag", "commands"), "it names a topic of a bag, or of a table of several topics"),
    "receive_stamps": (("bag",), "a ROS bag alone has times of receipt"),
    "full_duty": (
        ("bag",),
        "the names of a table's columns say it: fl_pct, or fl_unit of 1, fl_pwm of 255",
    ),
    "wheelbase_m": (("bag", "commands"), "it is for commands that are steering angles"),
    "wheel_factor": (("told",), "it is for commands that are wheel speeds"),
    "command_timeout_s": (("told",), "it ends commands"),
    "same_clock": (("told",), "without commands there is one clock alone"),
    "heading_from_path": (("told",), "the commands tell along which axis a robot goes"),
}


def check_sources(given: Sources, options: ImportOptions) -> None:
    """Raises LogError where sources do not go together, or have no use for an option."""
    if options.up not in ("x", "y", "z", None):
        raise LogError(f"{option('up', options.up)}: must be x, y or z.")
    captures = [path for path in (given.poses, given.motive, given.vicon) if path]
    if given.bag and (captures or given.commands or given.io_tsv):
        raise LogError(
            f"{option('bag')}: holds poses and commands; give no other source beside it."
        )
    if not given.bag and (len(captures) != 1 or (given.commands and given.io_tsv)):
        raise LogError(
            "a log needs one source of poses, and one of commands unless it is of poses alone: "
            f"give {option('poses')}, {option('motive')} or {option('vicon')}, and "
            f"{option('commands')} or {option('io_tsv')}."
        )
    several = max(len(given.poses), len(given.commands), len(given.io_tsv)) > 1
    if options.robot_id is not None and (not 0 <= options.robot_id <= 99 or several):
        raise LogError(
            f"{option('robot_id', options.robot_id)}: must be in 0..99 and fits one robot; "
            "number several by the names of their files or of their folders."
        )
    told = given.commands or given.io_tsv or (given.bag and options.command_topics)
    there = {name for name in ("poses", "commands", "bag") if getattr(given, name)}
    there |= {"told"} if told else set()
    asked = {
        "mapping": options.mapping,
        "pose": options.pose_topics,
        "command": options.command_topics,
        "receive_stamps": options.receive_stamps,
        "full_duty": options.full_duty is not None,
        "wheelbase_m": options.wheelbase_m is not None,
        "wheel_factor": options.wheel_factor is not None,
        "command_timeout_s": options.command_timeout_s is not None,
        "same_clock": options.same_clock,
        "heading_from_path": options.path_heading,
    }
    for name, (users, remedy) in USES.items():
        if asked[name] and not there & {*users}:
            raise LogError(
                f"{option(name)}: nothing that is read has a use for it: {remedy}; leave it out."
            )
    for name in ("pose", "command"):
        if len(asked[name]) > 1 and not given.bag:
            raise LogError(
                f"{option(name, [asked[name][1]])}: of a table one topic is read; name one."
            )


def check_numbered(
    options: ImportOptions, poses: list[PoseSeries], commands: list[CommandSeries]
) -> None:
    """Raises LogError where a number for one robot was given, and no source is of one."""
    number = options.robot_id
    ids = sorted({series.robot_id for series in (*poses, *commands)})
    if number is None or number in ids:
        return
    raise LogError(
        f"{option('robot_id', number)}: the files hold several robots "
        f"({', '.join(map(str, ids))}), each "
        "with its number; leave the option out, or number each with "
        f"{option('robot', {'NAME': 'ID'})}."
    )


def named_robots(given: Flips | OfRobots) -> list[int | None]:
    """Robots that an option was given for, None for all; none of an option at its default."""
    if isinstance(given, Mapping):
        return list(given)
    return [None] if given else []
