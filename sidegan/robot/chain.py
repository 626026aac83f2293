"""Which joints of a description are the arm's, and where the others stand."""

import re
from dataclasses import dataclass

from sidegan.errors import RobotError
from sidegan.robot import xml
from sidegan.robot.setup import Setup, listed, override
from sidegan.robot.tree import MOVABLE, Joint, Tree, meant, refuse_kind

_GRIPPER = re.compile(r"gripper|finger|thumb|knuckle|jaw", re.IGNORECASE)
_MOST_TIPS = 6  # that are offered


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
    for name in given:
        _check_locked(tree, name, given[name])
    path = _path(tree, setup)
    moving = tuple(joint for joint in path if _moves(joint) and joint.name not in given)
    if not moving:
        for joint in tree.joints.values():
            refuse_kind(joint, tree.at(joint))
        raise RobotError(
            f"{tree.where} has no joints that move, expected at least one, revolute or prismatic"
        )
    names = {joint.name for joint in moving}
    for joint in path:
        if joint.kind not in MOVABLE and joint.name not in given:
            refuse_kind(joint, tree.at(joint))
    others = [j for j in tree.joints.values() if j.kind != "fixed" and j.name not in names]
    locked: dict[str, float] = {}
    for joint in others:
        _lock(tree, setup, joint, names, locked, ())
    return Chain(moving, locked)


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
        if _moves(joint) and joint.name not in given and path[: len(before)] == before:
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
    """What to choose from: the ends of all branches, the longest first, and where they part."""
    inner = {joint.name for before in carriers.values() for joint in before}
    ends = sorted((name for name in paths if name not in inner), key=lambda name: -len(carriers[name]))
    words = []
    for name in [*ends[:_MOST_TIPS], *([fork] if fork else [])]:
        joints = [*(joint.name for joint in carriers[name]), name]
        count = f"{len(joints)} joint" + ("s" if len(joints) > 1 else "")
        words.append(f"robot.tip={tree.joints[name].child} ({count}: {_span(joints)})")
    return words


def _span(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{names[0]} to {names[-1]}"


def _check_locked(tree: Tree, name: str, value: float) -> None:
    """Raise unless a joint is there, can move, and can stand where it is to stand."""
    joint = tree.joints.get(name)
    if joint is None:
        movable = [one.name for one in tree.joints.values() if one.kind in MOVABLE]
        raise RobotError(
            f"{tree.where} has no joint {name!r} that robot.locked could lock{meant(name, movable)}"
        )
    if joint.kind not in MOVABLE:
        raise RobotError(f"{tree.at(joint)} is {joint.kind}: leave it out of robot.locked")
    span = _range(tree, joint)
    if span and not span[0] <= value <= span[1]:
        nearest = min(max(value, span[0]), span[1])
        raise RobotError(
            f"{tree.at(joint)} is locked at {value:g}, outside its range {span[0]:g} to {span[1]:g}; the "
            f"nearest is {override('locked', {name: nearest})}"
        )


def _range(tree: Tree, joint: Joint) -> tuple[float, float] | None:
    """A joint's range, where it has one [rad or m]."""
    limit = joint.element.find("limit")
    if joint.kind == "continuous" or limit is None or not {"lower", "upper"} & set(limit.attrib):
        return None
    lower, upper = (xml.number(limit, key, tree.at(joint), "0") for key in ("lower", "upper"))
    return (lower, upper) if lower < upper else None


def _lock(
    tree: Tree, setup: Setup, joint: Joint, moving: set[str], locked: dict[str, float], asked: tuple[str, ...]
) -> float:
    """Where a joint stands that does not move: as the user says, as what it mimics, or in the middle."""
    if joint.name in locked:
        return locked[joint.name]
    given = setup.locked or {}
    if joint.name in given:
        value = given[joint.name]
    elif joint.mimic is not None:
        value = _followed(tree, setup, joint, moving, locked, asked)
    else:
        span = _range(tree, joint)
        value = sum(span) / 2 if span else 0.0
    locked[joint.name] = value
    return value


def _followed(
    tree: Tree, setup: Setup, joint: Joint, moving: set[str], locked: dict[str, float], asked: tuple[str, ...]
) -> float:
    """Where a joint stands that mimics another: multiplier · its position + offset."""
    at, remedy = tree.at(joint), override("locked", {joint.name: 0.0}, setup.locked)
    mimic = joint.element.find("mimic")
    assert mimic is not None
    name = mimic.get("joint", "")
    if name not in tree.joints or name in (*asked, joint.name):
        raise RobotError(f"{at} mimics {name!r}, expected another joint; {remedy} has it stand still")
    if name in moving:
        raise RobotError(
            f"{at} mimics another, {name!r}, expected joints that move on their own; {remedy} has it stand "
            "still"
        )
    followed = tree.joints[name]
    here = (
        0.0
        if followed.kind == "fixed"
        else _lock(tree, setup, followed, moving, locked, (*asked, joint.name))
    )
    factor, offset = (
        xml.number(mimic, key, at, text) for key, text in (("multiplier", "1"), ("offset", "0"))
    )
    return factor * here + offset


def tell(tree: Tree, chain: Chain, masses: dict[str, float]) -> list[str]:
    """What was locked, and whose mass was lumped into which link.

    Args:
        tree: the whole description.
        chain: the part of it that moves.
        masses: of the links [kg].
    """
    if not chain.locked:
        return []
    told = [
        "locked " + listed([_stands(tree.joints[name], value) for name, value in chain.locked.items()], 12)
    ]
    carried = {joint.child: joint.child for joint in chain.moving}
    lumped: dict[str, list[str]] = {}
    for link in tree.links:
        path = tree.path(link)
        if any(joint.name in chain.locked for joint in _behind(path, carried)):
            carrier = next((j.child for j in reversed(path) if j.child in carried), "")
            lumped.setdefault(carrier, []).append(link)
    for carrier, links in lumped.items():
        mass = sum(masses.get(link, 0.0) for link in links)
        told.append(
            f"{mass:.4g} kg of {listed(links)} lumped into {carrier}"
            if carrier
            else f"standing still with the base: {listed(links)}"
        )
    return told


def _stands(joint: Joint, value: float) -> str:
    """Where a joint stands, for people."""
    if joint.kind not in MOVABLE:
        return f"{joint.name} at its origin"
    return f"{joint.name} at {value:.4g} {'m' if joint.kind == 'prismatic' else 'rad'}"


def _behind(path: list[Joint], carried: dict[str, str]) -> list[Joint]:
    """The joints of a path behind the last one that moves."""
    last = max((i for i, joint in enumerate(path) if joint.child in carried), default=-1)
    return path[last + 1 :]
