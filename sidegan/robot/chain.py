"""Choice of a description's joints that form the arm; the others are fixed."""

import re

from sidegan.base.names import counted
from sidegan.errors import RobotError
from sidegan.robot.fixed_joints import check_locked, fixed_positions
from sidegan.robot.setup import Setup, override, setting
from sidegan.robot.tree import MOVABLE, REFUSED, Joint, Tree

_GRIPPER = re.compile(r"gripper|finger|thumb|knuckle|jaw", re.IGNORECASE)
_MOST_TIPS = 7  # suggested in a message
_ARM, _HAND = 6, 8  # fewest joints before a hand, and most joints of its longest finger
_ARM, _HAND = 6, 8  # fewest joints before a hand, and most joints of its longest finger


def choose(tree: Tree, setup: Setup) -> tuple[tuple[Joint, ...], dict[str, float]]:
    """The arm's joints, from the base outwards, and the positions of all others [rad or m]."""
    given = setup.locked or {}
    for name, value in given.items():
        check_locked(tree, name, value)
    path = _path(tree, setup)
    for joint in path or tree.joints.values():
        if joint.kind in REFUSED and joint.name not in given:
            still = override("locked", {joint.name: 0.0}, given)
            raise RobotError(
                f"{tree.at(joint)} is {joint.kind}: {REFUSED[joint.kind]}; {still} locks it at its origin"
            )
    moving = tuple(joint for joint in path if _moves(joint) and joint.name not in given)
    if not moving:
        unlocked = " that are not locked" if given else ""
        raise RobotError(
            f"{tree.where} has no movable joints{unlocked}, expected at least one revolute or prismatic"
        )
    return moving, fixed_positions(tree, moving, given)


def _path(tree: Tree, setup: Setup) -> list[Joint]:
    """All joints, of any kind, from the root to the tip."""
    if setup.tip:
        tree.require_link(setup.tip, "robot.tip=")
        return tree.path(setup.tip)
    given = setup.locked or {}
    paths = {
        joint.name: tree.path(joint.child)
        for joint in tree.joints.values()
        if _moves(joint) and joint.name not in given
    }
    carrying = {joint.name for name in paths if not _GRIPPER.search(name) for joint in paths[name]}
    paths = {name: path for name, path in paths.items() if name in carrying} or paths
    return _only(tree, paths) if paths else []


def _moves(joint: Joint) -> bool:
    """Whether a joint has one degree of freedom of its own."""
    return joint.kind in MOVABLE and joint.mimic is None


def _only(tree: Tree, paths: dict[str, list[Joint]]) -> list[Joint]:
    """The path to the last joint; raises unless all others lie on it."""
    inner = {joint.name for path in paths.values() for joint in path[:-1]}
    ends = [name for name in paths if name not in inner]
    if len(ends) == 1:
        return paths[ends[0]]
    chains = [[joint for joint in paths[name] if joint.name in paths] for name in ends]
    shared = [column[0] for column in zip(*chains) if len({joint.name for joint in column}) == 1]
    branches = dict.fromkeys(repr(chain[len(shared)].name) for chain in chains)
    tips = sorted((_before_hand(chain, chains) for chain in chains), key=len, reverse=True)
    offered = dict.fromkeys(
        f"{setting('tip', tip[-1].child)} ({counted(len(tip), 'joint')}: {tip[0].name} to {tip[-1].name})"
        for tip in ([*tips, shared] if shared else tips)
    )
    carrier = f"joint {shared[-1].name!r}" if shared else "the base"
    raise RobotError(
        f"{tree.where}: joints {' and '.join(branches)} branch off {carrier}, expected one chain; "
        f"choose its tip: {'; or '.join([*offered][:_MOST_TIPS])}"
    )


def _before_hand(chain: list[Joint], chains: list[list[Joint]]) -> list[Joint]:
    """The joints of a chain before its hand, several short branches behind an arm; all if there is none."""
    for k in range(_ARM, len(chain)):
        fingers = [other[k:] for other in chains if other[:k] == chain[:k]]
        if len({finger[0].name for finger in fingers}) > 1 and max(map(len, fingers)) <= _HAND:
            return chain[:k]
    return chain
