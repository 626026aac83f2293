"""Which joints of a description are the arm's, and where the others stand."""

import re
from dataclasses import dataclass

from sidegan.errors import RobotError
from sidegan.robot.setup import Setup, choice
from sidegan.robot.standing import check_locked, standing
from sidegan.robot.tree import MOVABLE, Joint, Tree, refuse_kind

_GRIPPER = re.compile(r"gripper|finger|thumb|knuckle|jaw", re.IGNORECASE)
_MOST_JOINTS = 32  # time grows with their third power: 60 take minutes before the first trajectory
_MOST_TIPS = 6  # that are offered
_ARM, _HAND = 6, 8  # joints at least before a hand, and below these of its longest finger


@dataclass(frozen=True)
class Chain:
    """The joints that move, from the base outwards, and where the others stand [rad or m]."""

    moving: tuple[Joint, ...]
    locked: dict[str, float]


def choose(tree: Tree, setup: Setup) -> Chain:
    """The arm that is meant.

    Raises:
        RobotError: when it is not one chain of joints that move on their own, with what resolves that.
    """
    given = setup.locked or {}
    for name, value in given.items():
        check_locked(tree, name, value)
    path = _path(tree, setup)
    moving = tuple(joint for joint in path if _moves(joint) and joint.name not in given)
    if not moving:
        for joint in tree.joints.values():
            refuse_kind(joint, tree.at(joint))
        raise RobotError(
            f"{tree.where} has no joints that move{_within(setup)}, expected at least one, revolute or "
            "prismatic"
        )
    if len(moving) > _MOST_JOINTS:
        raise RobotError(
            f"{tree.where} has {len(moving)} joints that move, expected at most {_MOST_JOINTS}: with "
            f"their number the work grows; {choice('tip', moving[_MOST_JOINTS - 1].child)} ends the arm there"
        )
    for joint in path:
        if joint.kind not in MOVABLE and joint.name not in given:
            refuse_kind(joint, tree.at(joint))
    return Chain(moving, standing(tree, moving, given))


def _within(setup: Setup) -> str:
    """Where joints were looked for, for a message."""
    ends = [f"{word} {link!r}" for word, link in (("behind", setup.base), ("before", setup.tip)) if link]
    ends += ["that are not locked"] if setup.locked else []
    return "".join(f" {one}" for one in ends)


def _path(tree: Tree, setup: Setup) -> list[Joint]:
    """The joints from the base to the tip, of whatever kind."""
    if setup.base:
        tree.require_link(setup.base, "robot.base=")
    before = tree.path(setup.base or tree.root)
    if setup.tip:
        tree.require_link(setup.tip, "robot.tip=")
        path = tree.path(setup.tip)
        if path[: len(before)] != before:
            raise RobotError(
                f"{tree.where}: link {setup.tip!r} does not hang on link {setup.base!r}; "
                f"leave one of them out: robot.base=null"
            )
        return path[len(before) :]
    given = setup.locked or {}
    paths = {}
    for joint in tree.joints.values():
        path = tree.path(joint.child)
        beyond = len(path) > len(before) and path[: len(before)] == before
        if beyond and _moves(joint) and joint.name not in given:
            paths[joint.name] = path[len(before) :]
    paths = _without_grippers(tree, paths)
    return _only(tree, paths, setup) if paths else []


def _moves(joint: Joint) -> bool:
    """Whether a joint has one degree of freedom of its own."""
    return joint.kind in MOVABLE and joint.mimic is None


def _without_grippers(tree: Tree, paths: dict[str, list[Joint]]) -> dict[str, list[Joint]]:
    """Paths to joints of the arm; all of them where nothing but grippers would be left out."""
    grips = {name for name in paths if _GRIPPER.search(name)} | _mimicked_beside(tree)
    arm = {name for name in paths if name not in grips}
    carrying = {joint.name for name in arm for joint in paths[name]}
    kept = {name: path for name, path in paths.items() if name in carrying}
    return kept or paths


def _mimicked_beside(tree: Tree) -> set[str]:
    """Joints that another one follows which does not hang on them: fingers that open together."""
    found = set()
    for joint in tree.joints.values():
        if joint.mimic is not None:
            master = joint.mimic.get("joint", "")
            if master not in {one.name for one in tree.path(joint.parent)}:
                found.add(master)
    return found


def _only(tree: Tree, paths: dict[str, list[Joint]], setup: Setup) -> list[Joint]:
    """The path to the last joint, which all others must lie on."""
    longest = max(paths.values(), key=len)
    on_it = {joint.name for joint in longest}
    if all(name in on_it for name in paths):
        return longest
    carriers = {name: [j for j in path[:-1] if j.name in paths] for name, path in paths.items()}
    hanging: dict[str, list[str]] = {}
    for name, before in carriers.items():
        hanging.setdefault(before[-1].name if before else "", []).append(name)
    carrier, branches = next((one, names) for one, names in hanging.items() if len(names) > 1)
    on = f"joint {carrier!r}" if carrier else "the base"
    both = " and ".join(repr(name) for name in branches)
    together = "both" if len(branches) == 2 else "all"
    raise RobotError(
        f"{tree.where}: joints {both} {together} hang on {on}, expected one chain; choose where it ends: "
        + "; or ".join(_tips(tree, paths, carriers, carrier))
    )


def _tips(
    tree: Tree, paths: dict[str, list[Joint]], carriers: dict[str, list[Joint]], fork: str
) -> list[str]:
    """Choices for a message: the ends of all branches, the longest first, and where they part."""
    inner = {joint.name for before in carriers.values() for joint in before}
    last = [_before_hand(name, carriers) for name in paths if name not in inner]
    ends = sorted(dict.fromkeys(last), key=lambda name: -len(carriers[name]))
    words = []
    for name in dict.fromkeys([*ends[:_MOST_TIPS], *([fork] if fork else [])]):
        joints = [*(joint.name for joint in carriers[name]), name]
        count = f"{len(joints)} joint" + ("s" if len(joints) > 1 else "")
        words.append(f"{choice('tip', tree.joints[name].child)} ({count}: {_span(joints)})")
    return words


def _before_hand(end: str, carriers: dict[str, list[Joint]]) -> str:
    """The last joint before a hand that a finger's last joint is part of; that joint where there is no hand.

    A hand is what hangs on one joint in several short branches, behind an arm.
    """
    for before in range(_ARM, len(carriers[end]) + 1):
        wrist = carriers[end][before - 1].name
        behind = {name: path for name, path in carriers.items() if wrist in {j.name for j in path}}
        first = {name for name, path in behind.items() if path[-1].name == wrist}
        if len(first) > 1 and max(len(path) for path in behind.values()) - before < _HAND:
            return wrist
    return end


def _span(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{names[0]} to {names[-1]}"
