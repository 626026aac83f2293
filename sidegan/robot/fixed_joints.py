"""Positions of joints that do not move, and notes on the links behind them."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence

from sidegan.base.names import listed
from sidegan.errors import RobotError
from sidegan.robot import xml
from sidegan.robot.arm import LOCKED
from sidegan.robot.setup import override
from sidegan.robot.tree import MOVABLE, Joint, Tree, meant


def fixed_positions(tree: Tree, moving: Sequence[Joint], given: Mapping[str, float]) -> dict[str, float]:
    """Positions of all joints that do not move [rad or m]: as given, as mimicked, or mid-range."""
    free = {joint.name for joint in moving}
    locked: dict[str, float] = {}
    wrong: dict[str, str] = {}  # joints with an invalid mimic, and why
    remedies: dict[str, float] = {}  # joints to lock, and where; their leaders, if these move

    def middle(joint: Joint) -> float:
        return sum(_range(tree, joint) or (0.0, 0.0)) / 2

    def stand(joint: Joint, followers: tuple[str, ...] = ()) -> float:
        if joint.name not in locked:
            if joint.name in given:
                locked[joint.name] = given[joint.name]
            elif joint.mimic is None:
                locked[joint.name] = middle(joint)
            else:
                locked[joint.name] = follow(joint, joint.mimic, (*followers, joint.name))
        return locked[joint.name]

    def follow(joint: Joint, mimic: ET.Element, followers: tuple[str, ...]) -> float:
        """Position of a joint that mimics another: multiplier · its position + offset."""
        at = tree.at(joint)
        name = mimic.get("joint", "")
        if name not in tree.joints or name in free or name in followers:
            wrong[joint.name] = f"{at} mimics {name!r}" if name else f"{at} mimics no joint"
            leads = name in free and len(free) > 1
            remedies[name if leads else joint.name] = middle(tree.joints[name]) if leads else 0.0
            return 0.0
        followed = tree.joints[name]
        here = 0.0 if followed.kind == "fixed" else stand(followed, followers)
        return xml.number(mimic, "multiplier", at, "1") * here + xml.number(mimic, "offset", at, "0")

    for joint in tree.joints.values():
        if joint.kind != "fixed" and joint.name not in free:
            stand(joint)
    if wrong:
        remedy = override("locked", remedies, given)
        first, *rest = wrong.values()
        reasons = "; ".join([first, *(why.removeprefix(f"{tree.where}: ") for why in rest)])
        raise RobotError(f"{reasons}: expected another joint that does not move; lock it by {remedy}")
    return locked


def check_locked(tree: Tree, name: str, value: float) -> None:
    """Raise unless a joint exists, can move, and has this position [rad or m] in its range."""
    joint = tree.joints.get(name)
    if joint is None:
        movable = [other.name for other in tree.joints.values() if other.kind != "fixed"]
        raise RobotError(f"{tree.where} has no joint {name!r} to lock (robot.locked){meant(name, movable)}")
    if joint.kind == "fixed":
        raise RobotError(f"{tree.at(joint)} is fixed: leave it out of robot.locked")
    span = _range(tree, joint)
    if span and not span[0] <= value <= span[1]:
        nearest = min(max(value, span[0]), span[1])
        raise RobotError(
            f"{tree.at(joint)} is locked at {value:g}, outside its range {span[0]:g} to {span[1]:g}; the "
            f"nearest is {override('locked', {name: nearest})}"
        )


def _range(tree: Tree, joint: Joint) -> tuple[float, float] | None:
    """A joint's range [rad or m]; None if it has no valid one."""
    span = tree.span(joint)
    return span if span and span[0] < span[1] else None


def describe_fixed(
    tree: Tree, moving: Sequence[Joint], locked: Mapping[str, float], masses: Mapping[str, float]
) -> list[str]:
    """Notes on locked joints with their positions [rad or m], and on masses [kg] lumped into other links."""
    if not locked:
        return []
    notes = [LOCKED + listed([_stands(tree.joints[name], value) for name, value in locked.items()], 12)]
    free = {joint.name for joint in moving}
    for name in locked:
        mimic = tree.joints[name].mimic
        leader = None if mimic is None else mimic.get("joint")
        if leader in free:
            notes.append(
                f"{name} is locked, but mimics {leader}, which moves: does it stand on your machine?"
            )
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
    return notes


def _stands(joint: Joint, value: float) -> str:
    """A joint with its position [rad or m], for people."""
    if joint.kind not in MOVABLE:
        return f"{joint.name} at its origin"
    return f"{joint.name} at {value:.4g} {'m' if joint.kind == 'prismatic' else 'rad'}"
