"""Words on an arm in its cell: what is suspicious in the description, and what was decided for the user."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from sidegan.base.names import counted, listed
from sidegan.robot import Arm, describe_doubtful_links, describe_placeholder_links, doubtful_links
from sidegan.robot.setup import allowed
from sidegan.validity.pairs import describe_displaced_shapes, mostly_touching
from sidegan.validity.placeholders import (
    describe_excessive_friction,
    describe_placeholder_limits,
    describe_weak_limits,
)

if TYPE_CHECKING:
    from sidegan.cell.cell import Cell


def doubts(cell: "Cell") -> Iterator[str]:
    """Where the description tells suspiciously little or much; some are empty."""
    arm, constraints = cell.arm, cell.constraints
    yield describe_placeholder_limits(cell.whole_arm)
    if cell.workspace.torque:
        yield describe_weak_limits(cell.whole_arm)
        yield describe_excessive_friction(cell.whole_arm)
    yield _touching(cell)
    yield describe_displaced_shapes(arm)
    yield _masses(arm)
    if placeholders := describe_placeholder_links(arm):
        yield (
            f"{placeholders}: torques, their limits, energies and what a set leaves uncertain mean "
            "nothing until a model is identified; goal.objective=condition needs no masses"
        )
    if constraints.arm.capsules.points:
        yield f"{arm.name} has no collision shapes: its joint origins alone keep out of regions"


def _masses(arm: Arm) -> str:
    """Links whose masses are doubtful, and the torques that depend on them."""
    masses = describe_doubtful_links(arm)
    if masses and not arm.inertial_parameters.any():
        return f"{masses}; torques are not known: their limits are not checked and no peaks are shown"
    if masses:
        last = max(map(arm.link_names.index, doubtful_links(arm)))
        moved = listed(arm.joint_names[: last + 1])
        return f"{masses}; torques of {moved} may differ much from those that are checked and shown"
    return ""


def _touching(cell: "Cell") -> str:
    """Links that touch in most configurations; empty where there are none."""
    touching = mostly_touching(cell.constraints.arm)
    said = listed([f"{' – '.join(links)} in {share:.0%}" for links, share in touching.items()])
    if not said:
        return ""
    return (
        f"links that touch in most configurations: {said}; correct their shapes, or, if nothing is "
        f"wrong with their touching, {allowed(touching, cell.arm.setup.may_touch)} leaves them unchecked"
    )


def decisions(cell: "Cell") -> Iterator[str]:
    """Decisions made for the user, and what trajectories are checked for; some are empty."""
    arm, constraints = cell.arm, cell.constraints
    yield cell.workspace.notes(arm)
    if cell.choices.home is None and (any(cell.home) or arm.home is not None):
        place, own = ", ".join(f"{x:g}" for x in cell.home), arm.home
        if own is not None and tuple(own) == cell.home:
            why = "home is where the description has the arm rest:"
        else:
            why = f"{'zeros are' if own is None else 'its own is'} no feasible home; home is"
        yield f"{why} {place}; trajectory.home=… sets another"
    if cell.choices.effort is None:
        why = "" if cell.effort < 1 else ", since less would hardly hold the arm"
        share = f"{cell.effort:.0%} of the velocity and torque limits{why}"
        yield f"effort: {share}; robot.effort=… sets another"
    yield _friction(cell)
    if cell.workspace.clearance is None and not constraints.arm.capsules.points:
        yield f"kept clear: {constraints.kept_clear}; workspace.clearance=… sets another distance"
    yield f"checked: {constraints.described()}"


def _friction(cell: "Cell") -> str:
    """What torque limits are checked with, where they are, of friction and rotors; empty otherwise."""
    if not cell.constraints.torque or not cell.setup.friction:
        return ""
    if cell.arm.drives is None:
        free = f"{1 - cell.effort:.0%} of the torque limits that are kept free are for it"
        return f"the description states no friction: the {free}" if cell.effort < 1 else ""
    viscous, dry, rotors = (int((x > 0).sum()) for x in vars(cell.arm.drives).values())
    return (
        f"torques count the description's damping of {viscous}, friction of {dry} and armature "
        f"of {counted(rotors, 'joint')}; robot.friction=false leaves it out"
    )
