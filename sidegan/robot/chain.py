"""Choice of a description's joints that form the arm; the positions of the others, and notes on these."""

import math
import re
from collections.abc import Mapping, Sequence

from sidegan.base.names import listed
from sidegan.base.settings_text import setting_name, suggest_by_joint, suggestion
from sidegan.errors import RobotError
from sidegan.robot.arm import LOCKED
from sidegan.robot.setup import Setup
from sidegan.robot.tree import MOVABLE, REFUSED, Tree, UrdfJoint, similar_names

_GRIPPER = re.compile(r"gripper|finger|thumb|knuckle|jaw", re.IGNORECASE)
_STILL = "motion, the torque for it, and collisions in other places are left out"
_MOST_TIPS = 6  # suggested in a message
_MOST_LOCKED = 12  # named in a note
_ARM, _HAND = 6, 8  # fewest joints before a hand, and most joints of its longest finger


def choose_chain(tree: Tree, setup: Setup) -> tuple[tuple[UrdfJoint, ...], dict[str, float]]:
    """The arm's joints, from the base outwards, and the positions of all others [rad or m]."""
    given = setup.locked or {}
    for name, value in given.items():
        _check_locked(tree, name, value, given)
    path = _path(tree, setup)
    for joint in path or tree.joints.values():
        if joint.kind in REFUSED and joint.name not in given:
            still = suggest_by_joint("locked", {joint.name: 0.0}, given)
            raise RobotError(
                f"{joint.at} is {joint.kind}: {REFUSED[joint.kind]}; {still} locks it at its origin"
            )
    moving = tuple(joint for joint in path if _moves(joint) and joint.name not in given)
    if not moving:
        before = f" before {setup.tip!r} ({setting_name('robot.tip')})" if setup.tip else ""
        unlocked = " that are not locked" if given else ""
        raise RobotError(
            f"{tree.where} has no movable joints{before}{unlocked}, "
            "expected at least one revolute or prismatic"
        )
    return moving, _fixed_positions(tree, moving, given)


def _path(tree: Tree, setup: Setup) -> list[UrdfJoint]:
    """All joints, of any kind, from the root to the tip."""
    if setup.tip:
        tree.require_link(setup.tip, "robot.tip")
        return tree.path(setup.tip)
    given = setup.locked or {}
    paths = {
        joint.name: tree.path(joint.child)
        for joint in tree.joints.values()
        if _moves(joint) and joint.name not in given
    }
    grips = {name for name in paths if _GRIPPER.search(name)} | _mimicked_beside(tree)
    carrying = {joint.name for name in paths if name not in grips for joint in paths[name]}
    paths = {name: path for name, path in paths.items() if name in carrying} or paths
    return _only(tree, paths) if paths else []


def _moves(joint: UrdfJoint) -> bool:
    """Whether a joint has one degree of freedom of its own."""
    return joint.kind in MOVABLE and joint.leader is None


def _mimicked_beside(tree: Tree) -> set[str]:
    """Joints mimicked by a joint that is not one of their descendants, as of fingers that open together."""
    found = set()
    for joint in tree.joints.values():
        ancestors = {ancestor.name for ancestor in tree.path(joint.parent)}
        if joint.leader is not None and joint.leader not in ancestors:
            found.add(joint.leader)
    return found


def _only(tree: Tree, paths: dict[str, list[UrdfJoint]]) -> list[UrdfJoint]:
    """The longest of these paths, by their last joints; raises unless all the others are parts of it."""
    inner = {joint.name for path in paths.values() for joint in path[:-1]}
    ends = [name for name in paths if name not in inner]
    if len(ends) == 1:
        return paths[ends[0]]
    chains = [[joint for joint in paths[name] if joint.name in paths] for name in ends]
    shared = [column[0] for column in zip(*chains) if len({joint.name for joint in column}) == 1]
    branches = dict.fromkeys(repr(chain[len(shared)].name) for chain in chains)
    tips = sorted((_before_hand(chain, chains) for chain in chains), key=len, reverse=True)
    offered = list(dict.fromkeys(map(_offered, tips)))[:_MOST_TIPS] + ([_offered(shared)] if shared else [])
    carrier = f"joint {shared[-1].name!r}" if shared else "the base"
    together = "both" if len(branches) == 2 else "all"
    raise RobotError(
        f"{tree.where}: joints {' and '.join(branches)} {together} branch off {carrier}, expected one chain; "
        f"choose its tip: {'; or '.join(dict.fromkeys(offered))}"
    )


def _before_hand(chain: list[UrdfJoint], chains: list[list[UrdfJoint]]) -> list[UrdfJoint]:
    """The joints of a chain before its hand, several short branches behind an arm; all if there is none."""
    for k in range(_ARM, len(chain)):
        fingers = [other[k:] for other in chains if other[:k] == chain[:k]]
        if len({finger[0].name for finger in fingers}) > 1 and max(map(len, fingers)) <= _HAND:
            return chain[:k]
    return chain


def _offered(chain: list[UrdfJoint]) -> str:
    """A choice of the arm's tip, for a message: the setting, and the joints up to there."""
    first, last = chain[0].name, chain[-1].name
    joints = f"{len(chain)} joints: {first} to {last}" if len(chain) > 1 else f"1 joint: {first}"
    return f"{suggestion('robot.tip', chain[-1].child)} ({joints})"


def _fixed_positions(tree: Tree, moving: Sequence[UrdfJoint], given: Mapping[str, float]) -> dict[str, float]:
    """Positions of all joints that do not move [rad or m]: as given, as mimicked, or mid-range."""
    free = [joint.name for joint in moving]
    locked: dict[str, float] = {}
    wrong: dict[str, str] = {}  # joints with an invalid mimic and loops through the arm, and why
    remedies: dict[str, float] = {}  # joints to lock, and where
    ends: list[str] = []  # settings that end the arm before a joint that one behind it mimics

    def middle(joint: UrdfJoint) -> float:
        lower, upper = joint.span or (0.0, 0.0)
        return (lower + upper) / 2 if lower < upper else 0.0

    def stand(joint: UrdfJoint, followers: tuple[str, ...] = ()) -> float:
        if joint.name not in locked:
            if joint.name in given:
                locked[joint.name] = given[joint.name]
            elif joint.leader is None:
                locked[joint.name] = middle(joint)
            else:
                locked[joint.name] = follow(joint, joint.leader, (*followers, joint.name))
        return locked[joint.name]

    def follow(joint: UrdfJoint, name: str, followers: tuple[str, ...]) -> float:
        """Position of a joint that mimics one of this name: multiplier · its position + offset."""
        if name not in tree.joints or name in free or name in followers:
            which = f"{name!r}, which moves" if name in free else repr(name) if name else "no joint"
            wrong[joint.name] = f"{joint.at} mimics {which}"
            lower, upper = joint.span or (-math.inf, math.inf)
            remedies[joint.name] = min(max(joint.number("mimic", "offset"), lower), upper)
            if name in free[1:] and tree.joints[name] in tree.path(joint.parent):
                ends.append(
                    f"; or end the arm before {name} by {suggestion('robot.tip', tree.joints[name].parent)}"
                )
            return 0.0
        followed = tree.joints[name]
        here = 0.0 if followed.kind == "fixed" else stand(followed, followers)
        return joint.number("mimic", "multiplier", "1") * here + joint.number("mimic", "offset")

    for joint in tree.joints.values():
        if joint.kind != "fixed" and joint.name not in free:
            stand(joint)
    arm = {joint.name for joint in tree.path(moving[-1].child)}
    for what, loop in tree.loops.items():
        beside = {name: locked[name] for name in locked if name in loop - arm}
        floats = any(
            tree.joints[name].kind in ("floating", "ball") for name in beside
        )  # so that the loop is open
        if loop & {*free} and not (floats or beside.keys() & given.keys()):
            wrong[what] = f"{tree.where}: {what} ties {listed([name for name in free if name in loop])}"
            remedies |= beside
    if wrong:
        locks = f"lock {listed([*remedies])} by {suggest_by_joint('locked', remedies, given)}: {_STILL}"
        remedy = locks if remedies else "delete it from the file if the arm does not have it"
        first, *rest = wrong.values()
        reasons = "; ".join([first, *(why.removeprefix(f"{tree.where}: ") for why in rest)])
        raise RobotError(f"{reasons}: this is not modelled; {remedy}{''.join(ends[:1])}")
    return locked


def _check_locked(tree: Tree, name: str, value: float, given: Mapping[str, float]) -> None:
    """Raise unless a joint exists, can move, and has this position [rad or m] in its range."""
    joint = tree.joints.get(name)
    if joint is None:
        movable = [other.name for other in tree.joints.values() if other.kind != "fixed"]
        at = f"({setting_name('robot.locked')})"
        raise RobotError(f"{tree.where} has no joint {name!r} to lock {at}{similar_names(name, movable)}")
    if joint.kind == "fixed":
        raise RobotError(f"{joint.at} is fixed: leave it out of {setting_name('robot.locked')}")
    lower, upper = joint.span or (0.0, 0.0)
    if lower < upper and not lower <= value <= upper:
        nearest = min(max(value, lower), upper)
        raise RobotError(
            f"{joint.at} is locked at {value:g}, outside its range {lower:g} to {upper:g}; the "
            f"nearest is {suggest_by_joint('locked', {name: nearest}, given)}"
        )


def describe_fixed(
    tree: Tree, moving: Sequence[UrdfJoint], locked: Mapping[str, float], masses: Mapping[str, float]
) -> list[str]:
    """Notes on locked joints with their positions [rad or m], and on masses [kg] lumped into other links."""
    notes = []
    if tree.loops:
        notes.append(f"constraints left out, so that trajectories may break them: {listed([*tree.loops])}")
    if not locked:
        return notes
    standing = []
    free = {joint.name for joint in moving}
    for name, value in locked.items():
        joint = tree.joints[name]
        standing.append(f"{name} at {f'{value:.4g} {joint.unit}' if joint.kind in MOVABLE else 'its origin'}")
        if joint.leader in free:
            notes.append(f"{name} mimics {joint.leader}, which moves: {_STILL}")
    lumped: dict[str, list[str]] = {}
    for link in tree.links:
        path = tree.path(link)
        first = 1 + max((i for i, joint in enumerate(path) if joint in moving), default=-1)
        if any(joint.name in locked for joint in path[first:]):
            lumped.setdefault(path[first - 1].child if first else "", []).append(link)
    for carrier, links in lumped.items():
        mass = sum(masses.get(link, 0.0) for link in links)
        notes.append(
            f"{mass:.4g} kg of {listed(links)} lumped into {carrier}"
            if carrier
            else f"fixed to the base: {listed(links)}"
        )
    return [LOCKED + listed(standing, _MOST_LOCKED), *notes]
