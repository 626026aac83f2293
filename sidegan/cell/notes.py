"""Warnings about an arm's description, and notes on defaults of its cell."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from sidegan.base.names import counted, listed
from sidegan.robot import describe_doubtful_links, describe_placeholder_links, doubtful_links
from sidegan.robot.arm import length_of
from sidegan.robot.setup import allowed
from sidegan.validity.pairs import describe_displaced_shapes, mostly_touching
from sidegan.validity.regions import distance
from sidegan.validity.remedies import (
    describe_excessive_friction,
    describe_placeholder_limits,
    describe_weak_limits,
)

if TYPE_CHECKING:
    from sidegan.cell.cell import Cell

_FAR = 10.0  # reaches of the arm


def doubts(cell: "Cell") -> Iterator[str]:
    """Sentences on what is suspicious in the description; some are empty."""
    arm, constraints = cell.arm, cell.constraints
    yield describe_placeholder_limits(cell.whole_arm)
    if cell.workspace.torque:
        yield describe_weak_limits(cell.whole_arm)
        yield describe_excessive_friction(cell.whole_arm)
    yield _far_regions(cell)
    if touching := mostly_touching(constraints.arm):
        pairs = listed([f"{' – '.join(links)} in {share:.0%}" for links, share in touching.items()])
        yield (
            f"links that touch in most configurations: {pairs}; correct their shapes or, if contact "
            f"is expected, leave them unchecked by {allowed(touching, arm.setup.may_touch)}"
        )
    yield describe_displaced_shapes(arm)
    masses = describe_doubtful_links(arm)
    if masses and not arm.inertial_parameters.any():
        yield f"{masses}; torques are unknown: torque limits are not checked, peaks are not shown"
    elif masses:
        last = max(map(arm.link_names.index, doubtful_links(arm)))
        moved = listed(arm.joint_names[: last + 1])
        yield f"{masses}; real torques of {moved} may differ greatly from those checked and shown"
    if placeholders := describe_placeholder_links(arm):
        yield (
            f"{placeholders}: torques, torque limits, energies and expected uncertainties mean "
            "nothing until a model is identified; goal.objective=condition needs no masses"
        )
    if constraints.arm.capsules.only_points:
        yield f"{arm.name} has no moving collision shapes: only its joint origins are kept out of regions"


def _far_regions(cell: "Cell") -> str:
    """A sentence on regions of the user that are far out of reach; empty if there are none."""
    own = len(cell.workspace.regions or [])
    regions = cell.constraints.regions
    reach = length_of(vars(cell.whole_arm))
    base = cell.whole_arm.translation[0]
    apart = {k: distance(region, base) for k, region in enumerate(regions[len(regions) - own :])}
    far = [f"workspace.regions[{k}] is {x:.3g} m away" for k, x in apart.items() if x > _FAR * reach]
    return f"{listed(far)}, and {cell.arm.name} reaches {reach:.2g} m: are these millimetres?" if far else ""


def decisions(cell: "Cell") -> Iterator[str]:
    """Sentences on defaults, and on what trajectories are checked for; some are empty."""
    arm, constraints = cell.arm, cell.constraints
    yield cell.workspace.notes(arm)
    if cell.choices.home is None and (any(cell.home) or arm.home is not None):
        place = ", ".join(f"{x:g}" for x in cell.home)
        own = arm.home
        if own is not None and tuple(own) == cell.home:
            why = "home is the rest position of the description:"
        else:
            why = f"{'zero' if own is None else 'the rest position'} is not a feasible home; home is"
        yield f"{why} {place}; trajectory.home=… changes it"
    if cell.choices.effort is None:
        why = "" if cell.effort < 1 else ", since less might not hold the arm up"
        share = f"{cell.effort:.0%} of the velocity and torque limits{why}"
        yield f"effort: {share}; robot.effort=… changes it"
    yield _friction(cell)
    if cell.workspace.clearance is None and not constraints.arm.capsules.only_points:
        yield f"kept clear: {constraints.kept_clear}; workspace.clearance=… changes it"
    yield f"checked: {constraints.described()}"


def _friction(cell: "Cell") -> str:
    """A sentence on friction and rotors in the check of torque limits; empty if there is no such check."""
    if not cell.constraints.torque or not cell.setup.friction:
        return ""
    if cell.arm.drives is None:
        free = f"{1 - cell.effort:.0%} of the torque limits in reserve must cover it"
        return f"the description has no friction: the {free}" if cell.effort < 1 else ""
    viscous, dry, rotors = (int((x > 0).sum()) for x in vars(cell.arm.drives).values())
    return (
        f"torques include the description's damping of {viscous}, friction of {dry} and armature "
        f"of {counted(rotors, 'joint')}; robot.friction=false leaves them out"
    )
