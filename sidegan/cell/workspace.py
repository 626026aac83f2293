"""Surroundings of the arm: keep-out regions, floor and clearance."""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from sidegan import validity
from sidegan.base.names import counted
from sidegan.base.settings_text import FILL_IN, setting_name, suggestion
from sidegan.base.storage import file_digest
from sidegan.base.typed import NonNegative, Number, Positive
from sidegan.cell.thresholds import KEPT_SHARE, USUAL_CLEARANCES
from sidegan.errors import ConfigError, InfeasibleError
from sidegan.robot import Arm, is_built_in
from sidegan.robot.meshes import metres_per_unit, read_mesh
from sidegan.robot.placement import from_rpy, stands
from sidegan.robot.thresholds import UPRIGHT
from sidegan.robot.units import meant_in_degrees
from sidegan.validity import Box, Constraints, Convex, Plane, Sphere
from sidegan.validity.floor import floor_is_known, floor_under, planes_of, with_points
from sidegan.validity.home import default_home, rests_at
from sidegan.validity.pairs import Links, usual_room

Point = tuple[Number, Number, Number]

_FIRST = ("plane", "box")  # kinds of regions that every stamp names, even if null
_BESIDE = 1 / KEPT_SHARE - 1  # room to move beside a kept distance, as a share of it
_STEPS = 1e3  # per metre; kept distances are whole steps


@dataclass(frozen=True)
class Cylinder:
    """A cylinder around the segment between two points [m]."""

    lower: Point
    upper: Point
    radius: Positive

    @property
    def shape(self) -> Convex:
        """The region."""
        return Convex.between(self.lower, self.upper, self.radius)


@dataclass(frozen=True)
class Mesh:
    """The convex hull of a mesh file."""

    file: str
    position: Point = (0.0, 0.0, 0.0)  # [m]
    rpy: Point = (0.0, 0.0, 0.0)  # [rad]
    scale: Positive | None = None  # metres per unit of the file; null: as the file states, or 1

    def __post_init__(self) -> None:
        if meant := meant_in_degrees(self.rpy):
            stated = [round(x, 6) for x in meant]
            raise ConfigError(f"rpy is {list(self.rpy)} rad: are these degrees? In radians they are {stated}")

    @property
    def path(self) -> Path:
        """The file, with the user's home in place of ~."""
        try:
            return Path(self.file).expanduser()
        except RuntimeError as error:
            raise ConfigError(f"mesh file {self.file} cannot be read: {error}") from error

    @property
    def shape(self) -> Convex:
        """The region."""
        points = (self.scale or metres_per_unit(self.path)) * read_mesh(self.path)
        return Convex.around(points @ from_rpy(self.rpy).T + np.array(self.position))


@dataclass(frozen=True)
class Region:
    """A keep-out region: exactly one of these shapes."""

    plane: Plane | None = None
    box: Box | None = None
    sphere: Sphere | None = None
    cylinder: Cylinder | None = None
    mesh: Mesh | None = None

    def __post_init__(self) -> None:
        if len(self._given) != 1:
            raise ConfigError("a region is exactly one of plane, box, sphere, cylinder or mesh")

    @property
    def _given(self) -> list[Any]:
        return [shape for field in fields(self) if (shape := getattr(self, field.name)) is not None]

    @property
    def shape(self) -> validity.Obstacle:
        """The region as the check takes it."""
        (shape,) = self._given
        return shape.shape if isinstance(shape, Cylinder | Mesh) else shape

    def stamped(self) -> dict[str, Any]:
        """Plain values that identify the region; files are identified by their contents."""
        plain = {name: x for name, x in asdict(self).items() if x is not None or name in _FIRST}
        if self.mesh is not None:
            try:
                plain["mesh"]["file"] = file_digest(self.mesh.path)
            except OSError as error:
                why = f"mesh file {self.mesh.file} cannot be read: {error.strerror}"
                raise ConfigError(f"workspace.regions: {why}") from error
        return plain


@dataclass(frozen=True, kw_only=True)
class Workspace:
    """Where the arm may move, and whether its torque limits count."""

    torque: bool = True
    regions: list[Region] | None = None  # in addition to the floor
    # height of the floor under built-in arms [m]; others: what they stand on; null: no floor
    desk: float | None = 0.1
    # distance of links from each other and from regions [m]; null: 2 cm, or what arm and home have room for
    clearance: NonNegative | None = None

    def given(self, arm: Arm) -> list[Region]:
        """All regions of an arm: the description's planes, the floor that it stands on, and configured ones.

        A floor among the description's planes replaces that floor, and one among the configured regions both.
        """
        own, _ = planes_of(arm) if self.desk is not None else ([], 0)
        if self._states_floor:
            own = [plane for plane in own if not _is_floor(plane)]
        elif self.desk is not None and not any(map(_is_floor, own)):
            floor = Plane((0.0, 0.0, 1.0), self.desk) if is_built_in(arm) else floor_under(arm)
            own = own if floor is None else [floor, *own]
        return [*(Region(plane=plane) for plane in own), *(self.regions or [])]

    def _floor_note(self, arm: Arm, own: Sequence[Plane]) -> str:
        """Note on an arm's floor, and the setting that changes it; ``own`` are the description's floors."""
        without = f"{suggestion('workspace', 'free')} removes it"
        if own:
            highest = max(plane.offset for plane in own)
            return f"floor at z = {highest:g} m, from the description; {without}"
        floor = floor_under(arm)
        if floor is None and stands(arm):
            why = (
                f"{arm.name} nearly always reaches below what it stands on, or another limb like it is lowest"
            )
            return f"no floor: {why}; {self._floor_setting(FILL_IN)} states its height"
        if floor is None:
            return f"no floor: {arm.name} does not stand upright; set keep-out regions by workspace.regions"
        height = f"floor at z = {floor.offset:g} m"
        if floor_is_known(arm):
            return f"{height}, which {arm.name} stands on; {without}"
        guess = f"a guess, since no visual or mesh shows what {arm.name} stands on"
        stated = self._floor_setting(float(f"{floor.offset:g}"))
        return f"{height}, {guess}: {stated} states its height; {without}"

    def _floor_setting(self, height: float | str) -> str:
        """The setting for a message that states a floor's height [m], with the regions given before."""
        floor = {"plane": {"normal": [0, 0, 1], "offset": height}}
        return suggestion("workspace.regions", [floor, *(self.regions or [])])

    @property
    def _states_floor(self) -> bool:
        """Whether an upward plane among the configured regions replaces the floor."""
        return any(region.plane is not None and _is_floor(region.plane) for region in self.regions or [])

    def shapes(self, arm: Arm) -> list[validity.Obstacle]:
        """Regions as the check takes them; ConfigError for an unreadable file."""
        return [region.shape for region in self.given(arm)]

    def around(self, arm: Arm, home: Sequence[float] | None = None) -> Constraints:
        """Constraints of an arm in this workspace; a default clearance leaves room at home (J,) [rad or m].

        Raises:
            ConfigError: when a file cannot be read or has an invalid shape.
            InfeasibleError: when links cannot be kept apart, or out of a region.
        """
        shapes = self.shapes(arm)
        arm = with_points(arm)
        if self.clearance is not None:
            return Constraints(arm, shapes, self.torque, self.clearance, self.clearance)
        if arm.capsules.only_points:  # distances between points mean nothing
            return Constraints(arm, shapes, self.torque)
        usual = USUAL_CLEARANCES[0]
        room = dict(usual_room(arm, usual / KEPT_SHARE))
        if home is not None:
            kept = _tight(room)  # so that pairs count that are close only with the clearance
            there = Constraints(arm, apart=usual, tight=kept).distances_at(np.array(home, float))
            room |= {links: min(room.get(links, gap), gap) for links, gap in there.items()}
        tight = _tight(room)
        for clearance in USUAL_CLEARANCES:
            with suppress(InfeasibleError):
                found = Constraints(arm, shapes, self.torque, clearance, usual, tight)
                if home is None or found.keeps_out(home, _BESIDE):
                    return found
        return Constraints(arm, shapes, self.torque, 0.0, usual, tight)

    def home_of(self, arm: Arm) -> tuple[float, ...] | None:
        """The described home [rad or m], (J,), if feasible, or one with room to move; None for zeros.

        Raises:
            ConfigError: when a file cannot be read or has an invalid shape.
            InfeasibleError: when links cannot be kept apart, or out of a region, or no home is found.
        """
        if arm.home is not None:
            with suppress(InfeasibleError):
                if rests_at(self.around(arm, arm.home), arm.home):
                    return tuple(arm.home)
        around = self.around(arm)
        if self.clearance is not None or around.arm.capsules.only_points:
            return default_home(around)
        for most in USUAL_CLEARANCES:  # the largest clearance that leaves room anywhere
            with suppress(InfeasibleError):
                clearance = min(most, around.clearance)
                kept = Constraints(around.arm, around.regions, self.torque, clearance, most, around.tight)
                return default_home(kept, _BESIDE)
        return default_home(Constraints(around.arm, around.regions, self.torque))

    def stamped(self, arm: Arm) -> dict[str, Any]:
        """Plain values that identify artifacts for an arm in this workspace."""
        regions = [region.stamped() for region in self.given(arm)]
        stamp: dict[str, Any] = {"torque": self.torque, "regions": regions}
        if len(arm.capsules.link) and (points := with_points(arm).capsules.points):
            stamp["joint_origins"] = points
        return stamp if self.clearance == 0 else stamp | {"clearance": self.clearance}

    def notes(self, arm: Arm) -> str:
        """Notes on floor and planes that the user did not set, or in vain; empty if there are none."""
        if self.desk is None or is_built_in(arm):
            return ""
        own, behind = planes_of(arm)
        notes = []
        if not self._states_floor:
            notes.append(self._floor_note(arm, [plane for plane in own if _is_floor(plane)]))
        if walls := [plane for plane in own if not _is_floor(plane)]:
            notes.append(f"kept out of: {counted(len(walls), 'plane')} of the description other than floors")
        if self.desk != Workspace.desk and not self._states_floor:
            unused = f"{setting_name('workspace.desk')} of {self.desk:g} m is for built-in arms only"
            notes.append(f"{unused}: {self._floor_setting(self.desk)} states a floor there")
        if behind:
            notes.append(f"planes that {arm.name} is nearly always behind are ignored: {behind}")
        return "; ".join(notes)


def _tight(room: Mapping[Links, float]) -> dict[Links, float]:
    """Distances to keep between links [m], of the room that they have [m]."""
    return {links: math.floor(KEPT_SHARE * max(gap, 0.0) * _STEPS) / _STEPS for links, gap in room.items()}


def _is_floor(plane: Plane) -> bool:
    """Whether a plane faces up."""
    return plane.unit[2] > UPRIGHT
