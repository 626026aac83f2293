"""Sets of trajectories of an arm in its cell, with their measures, as arrays, tables and files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from sidegan.base.arrays import Array
from sidegan.base.names import plain
from sidegan.base.settings_text import FILL_IN, suggestion
from sidegan.base.storage import path_of
from sidegan.base.typed import build, settings_of
from sidegan.cell import Cell, TrajectoryFamily, coefficients_of, require_cell
from sidegan.controllers import ExportSettings, export_set, require_exportable, slower
from sidegan.design.excitation import condition_of, information_of
from sidegan.design.search import ConditionGoal
from sidegan.design.selection import Selection, choose
from sidegan.errors import ConfigError, InfeasibleError, ShapeError
from sidegan.identification.goals import Uncertain
from sidegan.library import LIBRARY, Library
from sidegan.library.measure import library_of
from sidegan.motion.trajectory import Motion, Trajectory
from sidegan.recording.commanded import FOLDER
from sidegan.steps.demands import demands_of, energy_of
from sidegan.steps.weak_sets import excitation_warnings
from sidegan.validity import check


@dataclass(frozen=True, eq=False)
class TrajectorySet:
    """N cyclic trajectories of an arm with J joints, and their measures.

    Attributes:
        cell: the arm in its cell.
        library: coefficients, margins of every constraint, and excitation of each trajectory, as arrays
            that cannot be changed.
        family: the trajectories' harmonics, period and home.
        aim: the goal that the set was designed for, if any.
    """

    cell: Cell
    library: Library
    family: Trajectory
    aim: Uncertain | ConditionGoal | None = None

    def __post_init__(self) -> None:
        # Measures would be wrong for other coefficients.
        object.__setattr__(self, "library", self.library.read_only())

    @classmethod
    def of(cls, cell: Cell, coefficients: ArrayLike, source: str = "given") -> "TrajectorySet":
        """Trajectories with these coefficients [rad/s], (N, J, H, 2), of the cell's family.

        Raises:
            ConfigError: when the cell is none.
            ShapeError: when they do not fit the family, are those of a set with another, or are empty.
        """
        require_cell(cell)
        c = coefficients_of(coefficients, cell)
        cell.trajectory.check(c)
        if not len(c):
            raise ShapeError("there are no coefficients, expected those of one trajectory or more")
        return cls(cell, library_of(cell.constraints, cell.trajectory, c, source), cell.trajectory)

    @classmethod
    def load(cls, folder: str | Path, cell: Cell) -> "TrajectorySet":
        """The set that ``save`` wrote to a folder, with its own period and home, checked again in this cell.

        Raises:
            ArtifactError: when there is none, or it is for an arm of another description, limits or effort.
        """
        require_cell(cell)
        stored = Library.load(path_of(folder, "folder") / LIBRARY, cell.arm)
        joints, harmonics, _ = stored.coefficients.shape[1:]
        family = Trajectory(joints, harmonics, stored.period, stored.home)
        library = library_of(cell.constraints, family, stored.coefficients, "")
        return cls(cell, replace(library, source=stored.source), family)

    def __len__(self) -> int:
        return len(self.library)

    def __getitem__(self, which: int | slice | Sequence[int] | Array) -> "TrajectorySet":
        """The trajectories with these indices, from 0, in this order."""
        rows = np.atleast_1d(np.arange(len(self))[which])
        if not len(rows):
            raise ShapeError(f"{which!r} selects none of these {len(self)} trajectories")
        return replace(self, library=self.library.take(rows), aim=None)  # the aim is that of all together

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        """The coefficients, which cannot be changed unless they are a copy."""
        return np.array(self.coefficients, dtype, copy=copy)

    def __repr__(self) -> str:
        return (
            f"TrajectorySet({len(self)} of {self.cell.arm.name}, {self.family.period:g} s each, "
            f"{int(self.valid.sum())} valid)"
        )

    @property
    def coefficients(self) -> Array:
        """Coefficients [rad/s], (N, J, H, 2): of joint, harmonic, and sine or cosine."""
        return self.library.coefficients

    @property
    def valid(self) -> Array:
        """Whether every constraint holds over the whole period, (N,)."""
        return self.library.valid

    @property
    def conditions(self) -> Array:
        """Condition number of YᵀY of each trajectory, (N,); infinite if a direction is not excited."""
        return self.library.fitness

    @cached_property
    def condition(self) -> float:
        """Condition number of YᵀY of all trajectories together; infinite if a direction is not excited."""
        return condition_of(information_of(self.cell.body, self.family, self.coefficients).sum(0))

    @property
    def warnings(self) -> list[str]:
        """Why the set hardly excites the arm, and what helps; empty for a good set."""
        return excitation_warnings(self.cell, self.family, self.coefficients, self.condition, self.aim)

    def select(
        self, count: int, method: str = "greedy", noise: Sequence[float] | None = None
    ) -> "TrajectorySet":
        """The best of the valid trajectories to execute together, in the order of choice.

        Args:
            count: number of trajectories to select.
            method: ``"greedy"``, the paper's score; or ``"d_optimal"`` or ``"a_optimal"``, which leave less
                error (docs/usage.md).
            noise: standard deviation of each joint's torque [N·m or N], (J,), which weights the joints; None:
                all alike. Not for ``"greedy"``.

        Raises:
            ConfigError: when there is no such method, or it ignores noise.
            ShapeError: when fewer are valid, or noise does not fit the arm.
        """
        settings = build(Selection, {"count": count, "method": method, "noise": noise})
        valid = self.library.take(np.flatnonzero(self.valid))
        if count > len(valid):
            raise ShapeError(f"cannot choose {count} of {len(valid)} valid trajectories ({len(self)} in all)")
        chosen = choose(settings, self.cell.body, self.family, valid.coefficients, valid.diagonal)
        return TrajectorySet(self.cell, valid.take(chosen), self.family)

    def motion(self, rate: float = 100.0) -> Motion:
        """Joint motion over one period, both ends included, at a rate [Hz]."""
        return self.family.roll_out(self.coefficients, self.family.times(rate))

    def to_frame(self, rate: float = 100.0) -> pd.DataFrame:
        """A row per trajectory and time: ``trajectory``, ``time`` [s], ``q_<joint>``, ``dq_…``, ``ddq_…``.

        Trajectories count from 1.
        """
        motion = self.motion(rate)
        number = np.repeat(np.arange(1, len(self) + 1), len(motion.time))
        columns = {"trajectory": number, "time": np.tile(motion.time, len(self))}
        for letters, signal in zip(("q", "dq", "ddq"), motion[1:]):
            x = signal.reshape(len(number), -1)
            columns |= {f"{letters}_{joint}": x[:, j] for j, joint in enumerate(self.cell.arm.joint_names)}
        return pd.DataFrame(columns)

    def at_speed(self, speed: float) -> "TrajectorySet":
        """The same paths at a share of the speed.

        Raises:
            ConfigError: when the speed is not in (0, 1], or a trajectory would take longer than 1e5 s.
            InfeasibleError: when a slower trajectory is invalid, as when a weak arm needs its accelerations
                to hold itself.
        """
        speed = build(ExportSettings, {"speed": speed}).speed
        if speed == 1:
            return self
        family, c = slower(self.family, self.coefficients, speed)
        build(TrajectoryFamily, {"period": family.period})  # its bounds hold at this speed, too
        found = check(self.cell.constraints, family, c)
        if not found.valid.all():
            first = int(found.valid.argmin())
            slow = [suggestion(name, FILL_IN) for name in ("robot.effort", "trajectory.period")]
            raise InfeasibleError(
                f"trajectory {first + 1} cannot be run at {speed:.0%} of the speed: "
                f"{found.failures(first)[0]}; design a slow one instead, by {' or '.join(slow)}"
            )
        library = library_of(self.cell.constraints, family, c, "")
        return replace(self, library=replace(library, source=self.library.source), family=family)

    def energy(self, rate: float = 100.0) -> Array:
        """Mechanical work of the joints, whether they drive or brake [J], (N,), summed at a rate [Hz]."""
        return energy_of(self.cell, self.motion(rate))

    def demands(self, rate: float = 100.0) -> pd.DataFrame:
        """Demands of each trajectory as text: peaks at a rate [Hz], clearance and energy."""
        return demands_of(self.cell, self.family, self.coefficients, self.conditions, rate)

    def save(
        self, folder: str | Path, controllers: ExportSettings | Mapping[str, Any] | None = None
    ) -> dict[str, float]:
        """Write the set, and files for controllers in ``trajectories/`` below the folder.

        Args:
            folder: created if missing.
            controllers: formats, rate, speed and so on: the fields of
                ``sidegan.controllers.ExportSettings``, such as ``{"formats": ["csv"], "rate": 1000}``.

        Returns:
            Duration [s] of each file, by name, in the order in which to send them.

        Raises:
            ConfigError: when a setting is unknown, out of range, or does not fit the arm.
            InfeasibleError: when a trajectory is invalid at this speed, or no path to home is free.
            StorageError: when a file cannot be written.
        """
        settings = settings_of(ExportSettings, controllers)
        if settings.rehearse:
            raise ConfigError("rehearse is for the command; in Python, sidegan.plant.Plant follows a motion")
        family, _ = slower(self.family, self.coefficients, settings.speed)
        require_exportable(self.cell.arm, family, settings)  # before a slow motion is sampled
        run = self.at_speed(settings.speed)
        files = path_of(folder, "folder") / FOLDER
        durations = export_set(self.cell.constraints, run.family, run.coefficients, settings, files)
        self.library.save(Path(folder) / LIBRARY)
        return durations

    def view(self, path: str | Path, rate: float = 100.0, steps: Sequence[tuple[str, str]] = ()) -> None:
        """Write an HTML page that animates the arm, with a table of the trajectories' demands.

        Args:
            path: of the page.
            rate: sampling rate for peaks [Hz].
            steps: instructions, a sentence and a command each.

        Raises:
            ArtifactError: when trimesh has no three.js.
            StorageError: when the page cannot be written.
        """
        from sidegan.report.viewer.page import write_view

        titles = [f"{k} · cond {plain(x)}" for k, x in enumerate(self.conditions.tolist(), 1)]
        shown = self.family, self.coefficients, titles, self.demands(rate)
        write_view(path_of(path, "path"), self.cell.constraints, self.cell.whole_arm, *shown, steps)
