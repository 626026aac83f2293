"""The arm in its cell, with defaults for what the user does not set."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sidegan.base.arrays import Array, numbers
from sidegan.base.storage import path_of
from sidegan.base.typed import build, settings_of
from sidegan.cell.notes import describe_decisions, describe_doubts
from sidegan.cell.settings import Choices
from sidegan.cell.workspace import Workspace
from sidegan.design.problem import Problem
from sidegan.errors import ConfigError, ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm, Setup, load_robot, with_effort
from sidegan.validity import Constraints, Validity, check, usual_effort
from sidegan.validity.home import refuse_degrees
from sidegan.validity.remedies import refuse_other_units

_SAMPLES = 60  # time points per period of an optimisation
_SAME = 1e-9  # [rad or m] tolerance of home in the middle of the limits


class Cell:
    """An arm in its cell: description, surroundings, effort and home position.

    Everything not given gets a default, which ``notes`` explains. Properties are computed on first access,
    and raise then: make a new cell for other settings. Units are SI, joints are in the order of the
    description.

    Args:
        robot: path of a URDF, xacro or MJCF file, the name of a built-in arm (``built_in_robots()``), or a
            name from robot_descriptions if that is installed.
        workspace: surroundings of the arm, and whether torque limits count: a ``Workspace``, or its fields,
            such as ``{"regions": [{"box": {"lower": [0.3, -0.5, 0], "upper": [0.8, 0.5, 0.4]}}]}``. None: the
            floor that the arm stands on.
        home: joint positions [rad or m], (J,), at which trajectories start and end. None: the home position
            of the description, or zeros, or else a position found by search.
        effort: share of the velocity and torque limits to use, in (0, 1]. None: 0.8, or 1 if that would
            hardly hold the arm.
        clearance: distance [m] that links keep from each other and from the regions. None: the workspace's,
            or else 2 cm, or what the arm and its home have room for.
        harmonics: number H of Fourier harmonics of the trajectories.
        period: duration of one trajectory [s].
        **setup: settings in addition to the description, the fields of ``sidegan.robot.Setup``: ``tip``,
            ``locked``, ``mount``, ``limits``, ``may_touch``, ``friction``, ``args``.

    Attributes:
        robot: as given.
        setup: settings in addition to the description.
        workspace: surroundings of the arm.
        choices: home, effort, clearance, harmonics and period as given.

    Raises:
        ConfigError: when a setting is unknown or out of range; names it.
    """

    def __init__(
        self,
        robot: str | Path,
        *,
        workspace: Workspace | Mapping[str, Any] | None = None,
        home: ArrayLike | None = None,
        effort: float | None = None,
        clearance: float | None = None,
        harmonics: int = 6,
        period: float = 16.0,
        **setup: Any,
    ) -> None:
        path = path_of(robot, "robot")
        if isinstance(setup.get("limits"), str | Path):
            setup["limits"] = {"file": setup["limits"]}
        own = {"home": home, "effort": effort, "clearance": clearance}
        self.robot = str(robot)
        self.setup = build(Setup, setup)
        self.choices = build(Choices, {**own, "harmonics": harmonics, "period": period})
        self.workspace = settings_of(Workspace, workspace)
        if self.choices.clearance is not None:
            self.workspace = replace(self.workspace, clearance=self.choices.clearance)
        # The same file for each use, wherever the process goes in between.
        self._description = self.robot
        with suppress(OSError):  # which loading reports
            if path.is_file():
                self._description = str(path.absolute())

    def __repr__(self) -> str:
        return f"Cell({self.robot!r}, harmonics={self.choices.harmonics}, period={self.choices.period:g})"

    @cached_property
    def whole_arm(self) -> Arm:
        """The arm with its full limits.

        Raises:
            RobotError: when the description is not a serial chain with limits, in SI units; says what helps.
        """
        arm = load_robot(self._description, self.setup, self.choices.home)
        if self.workspace.torque:
            refuse_other_units(arm)
        return arm

    @cached_property
    def recorded_arm(self) -> Arm:
        """The arm as needed for recordings: without meshes, and with defaults for missing limits.

        Raises:
            RobotError: when the description is not a serial chain.
        """
        return load_robot(self._description, self.setup, self.choices.home, planning=False)

    def recorded_with(self, locked: Mapping[str, float]) -> Arm:
        """The arm as needed for recordings, with more of its joints locked at positions [rad or m]."""
        home = self.choices.home
        if home is not None:
            home = [q for name, q in zip(self.recorded_arm.joint_names, home) if name not in locked]
        setup = replace(self.setup, locked={**(self.setup.locked or {}), **locked})
        return load_robot(self._description, setup, home, planning=False)

    @cached_property
    def arm(self) -> Arm:
        """The arm with its velocity and torque limits scaled by the effort."""
        return with_effort(self.whole_arm, self.effort)

    @cached_property
    def effort(self) -> float:
        """Share of the velocity and torque limits to use."""
        if self.choices.effort is not None:
            return self.choices.effort
        return usual_effort(self.whole_arm, self.choices.home)

    @cached_property
    def _home(self) -> Sequence[float] | None:
        """Home [rad or m], (J,): as given, as described, or found; None for zeros."""
        if self.choices.home is not None:
            return self.choices.home
        return self.workspace.home_of(self.arm)

    @property
    def home(self) -> tuple[float, ...]:
        """Joint positions [rad or m] at which trajectories start and end, (J,).

        Raises:
            InfeasibleError: when no position is found at which the arm can rest; says why.
        """
        return tuple(self.trajectory.home or ())

    @cached_property
    def trajectory(self) -> Trajectory:
        """The family of short trajectories, which turns coefficients (B, J, H, 2) [rad/s] into motion."""
        return Trajectory(self.arm.joints, self.choices.harmonics, self.choices.period, self._home)

    @cached_property
    def constraints(self) -> Constraints:
        """The constraints of the arm in its workspace, for which trajectories are checked.

        Raises:
            ConfigError: when home is in degrees, or a file of the workspace cannot be read.
            InfeasibleError: when the arm cannot rest at home; says why.
        """
        refuse_degrees(self.arm, self.home, "trajectory.home")
        around = self.workspace.around(self.arm, self.home)
        around.refuse_home(self.home)
        return around

    @property
    def body(self) -> RigidBody:
        """Dynamics of the arm: torques, regressor and base parameters."""
        return self.constraints.body

    @property
    def problem(self) -> Problem:
        """The optimisation problem of short trajectories, with enough samples for all harmonics."""
        samples = max(_SAMPLES, 2 * self.trajectory.harmonics + 1)
        return Problem(self.constraints, self.trajectory, samples)

    @property
    def warnings(self) -> list[str]:
        """Sentences on what is suspicious in the description."""
        return describe_doubts(self.whole_arm, self.workspace, self.constraints)

    @property
    def notes(self) -> list[str]:
        """Sentences on the description's joints, defaults, and what trajectories are checked for."""
        decisions = describe_decisions(
            self.arm, self.workspace, self.constraints, self.choices, self.home, self.effort
        )
        return [*describe_notes(self.whole_arm), *decisions]

    def check(self, coefficients: ArrayLike) -> Validity:
        """Validity of short trajectories [rad/s], (B, J, H, 2), over their whole period.

        Raises:
            ShapeError: when they are not of this family, or a set of another arm, period or home.
        """
        return check(self.constraints, self.trajectory, coefficients_of(coefficients, self))

    def torque(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Torque of the description [N·m or N], (…, J), including its friction and rotors.

        At positions [rad or m], velocities and accelerations, (…, J) each.

        Raises:
            ShapeError: when the states do not have equal shapes (…, J).
        """
        return self.body.drive_torque(q, dq, ddq)

    def stamped(self) -> dict[str, Any]:
        """Plain values that, with the arm's digest, identify what is made for this cell."""
        home = None if self._home is None else list(self._home)
        family = {"harmonics": self.choices.harmonics, "period": self.choices.period, "home": home}
        middle = (self.arm.position_lower + self.arm.position_upper) / 2
        away = np.nan_to_num(np.abs(middle - np.array(self.home))).max()
        if away >= _SAME:  # since version 2, joints go as far as their limits on either side of home
            family["rooms"] = 2
        return {"workspace": self.workspace.stamped(self.arm), "trajectory": family}

    def identity(self) -> dict[str, Any]:
        """Plain values that identify what is made for this cell, with the arm's digest."""
        return {"arm": self.arm.digest, **self.stamped()}


def require_cell(given: object) -> None:
    """Refuse everything but a cell, such as the path of a description, by a ConfigError."""
    if not isinstance(given, Cell):
        robot = str(given) if isinstance(given, str | Path) else "arm.urdf"
        raise ConfigError(f"cell is {given!r}, expected a Cell, such as sidegan.Cell({robot!r})")


def coefficients_of(given: ArrayLike, cell: Cell) -> Array:
    """Coefficients [rad/s], (N, J, H, 2), of a ``TrajectorySet`` of the cell's arm and family, or as given.

    Raises:
        ShapeError: when a set is of another arm, period, home or number of harmonics, or for no numbers.
    """
    own: Any = getattr(given, "cell", None)  # of a set, whose class is not known here
    if isinstance(own, Cell):
        family: Trajectory = getattr(given, "family")  # noqa: B009
        if family != cell.trajectory or own.whole_arm.digest != cell.whole_arm.digest:
            raise ShapeError(
                f"the set is of {own.arm.name}, {family}; the cell has {cell.arm.name}, "
                f"{cell.trajectory}: pass set.coefficients if the same numbers are meant for this cell"
            )
    return numbers(given, "coefficients")


def describe_notes(arm: Arm) -> list[str]:
    """An arm's notes in one sentence; empty if there are none."""
    return [f"{arm.name}: {'; '.join(arm.notes)}"] if arm.notes else []
