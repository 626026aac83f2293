"""Design a set of trajectories to execute, for a goal."""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.random import number
from sidegan.base.settings_text import suggestion
from sidegan.base.storage import read_json
from sidegan.base.typed import changed, settings_of
from sidegan.cell import Cell, require_cell
from sidegan.design.beside import compile_beside
from sidegan.design.problem import SearchSettings
from sidegan.design.search import ConditionGoal, design_set
from sidegan.errors import ConfigError, SideganError
from sidegan.identification import GoalSettings, Terms
from sidegan.identification.goals import Uncertain, uncertainty_of_description, usual_torque
from sidegan.identification.model import TorqueModel
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Arm
from sidegan.steps.trajectories import TrajectorySet

_ROUNDED = 2e-3  # largest relative difference of rounded numbers in equal formulas
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
    """Design trajectories to execute on an arm, all proven valid, in order of increasing energy.

    Args:
        cell: the arm in its cell.
        count: number N of trajectories, each designed given those before it; None: that of the goal, or 10.
        seed: random seed; the same seed gives the same set.
        goal: objective of the set and noise of its measurement: the fields of ``GoalSettings``, such as
            ``{"objective": "parameters"}``.
        search: effort per trajectory: the fields of ``SearchSettings``.
        model: torque terms to identify in addition to rigid bodies: the fields of ``Terms``.
        known: folder with the results of an identification, to reduce its remaining uncertainty; its torque
            terms replace the default ones of ``model``. None: only the description is known.

    Returns:
        The set: ``coefficients`` (N, J, H, 2) [rad/s], ``motion(rate)``, ``condition``, ``to_frame()``,
        ``save(folder)``. It has fewer trajectories if some hardly move or are not proven.

    Raises:
        ConfigError: when a setting is out of range or does not fit the arm.
        InfeasibleError: when no trajectory is proven valid; names the violated constraints.
    """
    require_cell(cell)
    compile_beside()
    settings = settings_of(GoalSettings, goal)
    settings = settings if count is None else changed(settings, {"count": count})
    aim = aim_of(cell, settings, settings_of(Terms, model), known)
    effort = settings_of(SearchSettings, search)
    c = design_set(cell.problem, aim, settings.count, effort, number(seed, "excite"))
    made = TrajectorySet.of(cell, c, "excite")
    return replace(made[made.energy().argsort(kind="stable")], aim=aim)


def aim_of(
    cell: Cell, goal: GoalSettings, terms: Terms, known: str | Path | None
) -> Uncertain | ConditionGoal:
    """The design goal of a set, before its first trajectory; a ConfigError if it does not fit the arm."""
    if goal.objective == "condition":
        if known is not None:
            named = suggestion("goal.objective", "condition")
            raise ConfigError(f"{named} uses no model: leave out known= or choose another")
        return ConditionGoal(cell.problem)
    if known is None:
        return uncertainty_of_description(cell.body, terms, goal)
    if not isinstance(known, str | Path):
        raise ConfigError(f"known is {known!r}, expected a folder with the results of an identification")
    found, covariance, certainty, rate = known_model(Path(known), cell.arm)
    if terms != Terms() and terms.kinds != found.kinds:
        raise ConfigError(f"{known} has other torque terms than model: leave out model, or identify anew")
    if goal.noise is not None:  # overrides the noise of the recordings
        certainty = 1 / goal.deviation(usual_torque(cell.body))
        rate = goal.rate
    return Uncertain(found, covariance, certainty, rate, goal.objective, identified=True)


def known_model(folder: Path, arm: Arm) -> tuple[TorqueModel, Array, Array, float]:
    """The model in a folder with the results of an identification; a ConfigError for any other folder or arm.

    Also returns the covariance of its parameters, (P, P), the inverse standard deviation of an independent
    sample's torque, (J,), and the rate of the samples [Hz].
    """
    from sidegan.report.identification import PARAMETERS  # slow: imports everything for reports

    path = folder / PARAMETERS
    try:
        numbers = read_json(path)
        if numbers["joints"] != list(arm.joint_names):
            raise ConfigError(f"{path} is for an arm with joints {', '.join(numbers['joints'])}")
        kinds: dict[str, Any] = {name: name in numbers["use"]["terms"] for name in _TERMS}
        model = TorqueModel(RigidBody(arm), Terms(**kinds, sign_width=numbers["sign_width"]))
        count = model.count  # what follows are effects on joints, which is no aim of a design
        if not _alike(" ; ".join(model.formulas), " ; ".join(numbers["formulas"][:count])):
            raise ConfigError(f"{path} is for another arm than {arm.name}: its link frames differ")
        covariance = np.array(numbers["covariance"], float)[:count, :count]
        return model, covariance, np.array(numbers["certainty"], float), float(numbers["rate"])
    except ConfigError:
        raise
    except (SideganError, KeyError, TypeError, ValueError, RuntimeError) as error:
        raise ConfigError(
            f"known is {str(folder)!r}, expected the folder of a run of +experiment=identify, or of "
            f"IdentifiedModel.save in Python: {error}"
        ) from error


def _alike(a: str, b: str) -> bool:
    """Whether two formulas are equal up to rounding of their numbers."""
    if _NUMBER.sub("#", a) != _NUMBER.sub("#", b):
        return False
    found, expected = np.array(_NUMBER.findall(a), float), np.array(_NUMBER.findall(b), float)
    return np.allclose(found, expected, rtol=_ROUNDED, atol=0)
