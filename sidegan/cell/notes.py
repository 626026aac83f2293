"""Warnings about an arm's description, and notes on defaults of its cell."""

from collections.abc import Sequence

import numpy as np

from sidegan.base.names import counted, listed
from sidegan.base.settings_text import FILL_IN, suggest_touching, suggestion
from sidegan.cell.settings import Choices
from sidegan.cell.thresholds import FAR_REGION
from sidegan.cell.workspace import Workspace
from sidegan.robot import Arm, describe_doubtful_links, describe_placeholder_links, doubtful_links
from sidegan.robot.arm import length_of
from sidegan.validity import Constraints
from sidegan.validity.pairs import describe_displaced_shapes, mostly_touching
from sidegan.validity.regions import distance
from sidegan.validity.remedies import (
    describe_excessive_friction,
    describe_placeholder_limits,
    describe_weak_limits,
)


def describe_doubts(arm: Arm, workspace: Workspace, constraints: Constraints) -> list[str]:
    """Sentences on what is suspicious in the description of an arm, which has its full limits here."""
    found = [describe_placeholder_limits(arm)]
    if workspace.torque:
        found += [describe_weak_limits(arm), describe_excessive_friction(arm)]
    found += [_far_regions(arm, workspace, constraints), _touching(constraints.arm)]
    found += [describe_displaced_shapes(arm), *_doubtful_masses(arm)]
    if constraints.arm.capsules.only_points:
        found.append(
            f"{arm.name} has no moving collision shapes: only its joint origins are kept out of regions"
        )
    return list(filter(None, found))


def _far_regions(arm: Arm, workspace: Workspace, constraints: Constraints) -> str:
    """A sentence on regions of the user that are far out of reach; empty if there are none."""
    own = len(workspace.regions or [])
    regions = constraints.regions[len(constraints.regions) - own :]
    reach = length_of(vars(arm))
    apart = {k: distance(region, arm.translation[0]) for k, region in enumerate(regions)}
    far = [f"workspace.regions[{k}] is {x:.3g} m away" for k, x in apart.items() if x > FAR_REGION * reach]
    return f"{listed(far)}, and {arm.name} reaches {reach:.2g} m: are these millimetres?" if far else ""


def _touching(arm: Arm) -> str:
    """A sentence on links that touch in most configurations; empty if there are none."""
    touching = mostly_touching(arm)
    if not touching:
        return ""
    pairs = listed([f"{' – '.join(links)} in {share:.0%}" for links, share in touching.items()])
    return (
        f"links that touch in most configurations: {pairs}; correct their shapes or, if contact "
        f"is expected, leave them unchecked by {suggest_touching(touching, arm.setup.may_touch)}"
    )


def _doubtful_masses(arm: Arm) -> list[str]:
    """Sentences on links that cannot be as described, and on masses that are placeholders."""
    found = []
    masses = describe_doubtful_links(arm)
    if masses and not arm.inertial_parameters.any():
        found.append(f"{masses}; torques are unknown: torque limits are not checked, peaks are not shown")
    elif masses:
        last = max(map(arm.link_names.index, doubtful_links(arm)))
        moved = listed(arm.joint_names[: last + 1])
        found.append(f"{masses}; real torques of {moved} may differ greatly from those checked and shown")
    if placeholders := describe_placeholder_links(arm):
        objective = suggestion("goal.objective", "condition")
        found.append(
            f"{placeholders}: torques, torque limits, energies and expected uncertainties mean "
            f"nothing until a model is identified; {objective} needs no masses"
        )
    return found


def describe_decisions(
    arm: Arm,
    workspace: Workspace,
    constraints: Constraints,
    choices: Choices,
    home: Sequence[float],
    effort: float,
) -> list[str]:
    """Sentences on defaults, and on what trajectories are checked for.

    ``arm`` is limited by the effort, a share of its limits; ``home`` is (J,) [rad or m].
    """
    found = [workspace.notes(arm)]
    if choices.home is None and (any(home) or arm.home is not None):
        found.append(_home(arm, home))
    if choices.effort is None:
        why = "" if effort < 1 else ", since less might not hold the arm up"
        share = f"{effort:.0%} of the velocity and torque limits{why}"
        found.append(f"effort: {share}; {suggestion('robot.effort', FILL_IN)} changes it")
    if constraints.torque and arm.setup.friction:
        found.append(_friction(arm, effort))
    if workspace.clearance is None and not constraints.arm.capsules.only_points:
        change = suggestion("workspace.clearance", FILL_IN)
        found.append(f"kept clear: {constraints.kept_clear}; {change} changes it")
    return [*filter(None, found), f"checked: {constraints.described()}"]


def _home(arm: Arm, home: Sequence[float]) -> str:
    """A sentence on a home (J,) [rad or m] that the user did not set."""
    own = arm.home
    if own is not None and tuple(own) == tuple(home):
        why = "home is that of the description:"
    else:
        other = "zero is not a feasible home" if own is None else "the description's home is not feasible"
        why = f"{other}; home is"
    place = ", ".join(f"{x:g}" for x in home)
    return f"{why} {place}; {suggestion('trajectory.home', FILL_IN)} changes it"


def _friction(arm: Arm, effort: float) -> str:
    """A sentence on friction and rotors in torques; empty if there are none, and no reserve for them."""
    if arm.drives is None:
        free = f"{1 - effort:.0%} of the torque limits in reserve must cover it"
        return f"the description has no friction: the {free}" if effort < 1 else ""
    joints = {name: int(np.count_nonzero(x)) for name, x in vars(arm.drives).items()}
    return (
        f"torques include the description's damping (of {counted(joints['viscous'], 'joint')}), friction "
        f"(of {joints['coulomb']}) and rotor inertia (of {joints['rotor_inertia']}); "
        f"{suggestion('robot.friction', False)} leaves them out"
    )
