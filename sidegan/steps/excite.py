"""The design of a set of trajectories to execute, for what they are to tell."""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.random import number
from sidegan.base.storage import read_json
from sidegan.base.typed import settings_of
from sidegan.cell import Cell
from sidegan.design.beside import compile_beside
from sidegan.design.problem import SearchSettings
from sidegan.design.search import ConditionGoal, design_set
from sidegan.errors import ConfigError, SideganError
from sidegan.identification import GoalSettings, Terms
from sidegan.identification.goals import usual_torque
from sidegan.identification.model import TorqueModel
from sidegan.identification.uncertain import Uncertain, unmeasured
from sidegan.library.measure import measured
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Arm
from sidegan.steps.trajectories import TrajectorySet

_ROUNDED = 2e-3  # relative difference of numbers in two formulas that differ in rounding alone
_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")
_TERMS = ("rotor_inertia", "viscous", "coulomb", "offset")


def excite(
    cell: Cell,
    count: int | None = None,
    seed: int = 0,
    *,
    goal: GoalSettings | Mapping[str, Any] | None = None,
    search: SearchSettings | Mapping[str, Any] | None = None,
    model: Terms | Mapping[str, Any] | None = None,
    known: str | Path | None = None,
) -> TrajectorySet:
    """Trajectories to execute on an arm, all proven valid, those that take least energy first.

    Args:
        cell: the arm in its cell.
        count: number N of trajectories, each designed given those before it; None: 10, or the goal's.
        seed: of all random numbers; the same one gives the same set.
        goal: what the set is to tell best, and what it is measured with: the fields of ``GoalSettings``, such
            as ``{"objective": "parameters"}``.
        search: how much is spent on each trajectory: the fields of ``SearchSettings``.
        model: terms of the torque beside rigid bodies that are to be identified: the fields of ``Terms``.
        known: folder in which an identification left its results, for what that left uncertain. None: the
            description is all that is known.

    Returns:
        The set: ``coefficients`` (N, J, H, 2) [rad/s], ``motion(rate)``, ``condition``, ``to_frame()``,
        ``save(folder)``. Trajectories that came to nothing are left out.

    Raises:
        ConfigError: when a setting is out of range or does not fit the arm.
        InfeasibleError: when no trajectory is proven; says what stands in its way.
    """
    compile_beside()
    aimed = settings_of(GoalSettings, goal)
    aimed = aimed if count is None else replace(aimed, count=count)
    aim = aim_of(cell, aimed, settings_of(Terms, model), known)
    searched = settings_of(SearchSettings, search)
    c = design_set(cell.problem, aim, aimed.count, searched, number(seed, "excite"))
    made = TrajectorySet(cell, measured(cell.constraints, cell.trajectory, c, "excite"), cell.trajectory, aim)
    return replace(made, library=made.library.take(made.energy().argsort(kind="stable")))


def aim_of(
    cell: Cell, goal: GoalSettings, terms: Terms, known: str | Path | None
) -> Uncertain | ConditionGoal:
    """What a set is designed for, before anything of it is; a ConfigError where it does not fit the arm."""
    if goal.objective == "condition":
        if known is not None:
            raise ConfigError("goal.objective=condition uses no model: leave out known= or choose another")
        return ConditionGoal(cell.problem)
    if known is None:
        return unmeasured(cell.body, terms, goal)
    found, covariance, certainty, rate = known_model(Path(known), cell.arm)
    if goal.noise is not None:  # what is measured next has another noise than the recordings
        certainty, rate = 1 / goal.deviation(usual_torque(cell.body)), goal.rate
    return Uncertain(found, covariance, certainty, rate, goal.objective, identified=True)


def known_model(folder: Path, arm: Arm) -> tuple[TorqueModel, Array, Array, float]:
    """The model that a run of identify left in its folder; a ConfigError for any other folder or arm.

    With it the covariance of its parameters' errors, (P, P), one over the deviation of an independent
    sample's torque, (J,), and the rate of the samples [Hz].
    """
    from sidegan.report.identification import PARAMETERS  # and with it all that makes a report

    path = folder / PARAMETERS
    try:
        numbers = read_json(path)
        if numbers["joints"] != list(arm.joint_names):
            raise ConfigError(f"{path} is for an arm with joints {', '.join(numbers['joints'])}")
        kinds = {name: name in numbers["use"]["terms"] for name in _TERMS}
        model = TorqueModel(RigidBody(arm), Terms(**kinds, sign_width=numbers["sign_width"]))
        if not _alike(" ; ".join(model.formulas), " ; ".join(numbers["formulas"])):
            raise ConfigError(f"{path} is for another arm than {arm.name}: its link frames differ")
        covariance, certainty = (np.array(numbers[name], float) for name in ("covariance", "certainty"))
        return model, covariance, certainty, float(numbers["rate"])
    except ConfigError:
        raise
    except (SideganError, KeyError, TypeError, ValueError, RuntimeError) as error:
        raise ConfigError(
            f"known is {str(folder)!r}, expected the folder of a run of +experiment=identify: {error}"
        ) from error


def _alike(one: str, other: str) -> bool:
    """Whether two formulas are the same but for the last digits of their numbers."""
    ours, theirs = ([float(x) for x in _NUMBER.findall(text)] for text in (one, other))
    alike = _NUMBER.sub("#", one) == _NUMBER.sub("#", other)
    return alike and bool(np.allclose(ours, theirs, rtol=_ROUNDED, atol=0))
