"""What a URDF says that drivers enforce beside its limits: soft limits, acceleration and jerk."""

from collections.abc import Container, Sequence

from sidegan.base.names import listed
from sidegan.robot import xml
from sidegan.robot.setup import override
from sidegan.robot.tree import Joint, Tree

# Attributes of a joint's limit, with whatever prefix.
_NAMES = {"acceleration": ("acceleration", "deceleration"), "jerk": ("jerk",)}


def tighten(tree: Tree, moving: Sequence[Joint], stated: Container[str]) -> list[str]:
    """Narrow the ranges in the tree's XML to the soft limits that are within them, and notes on that.

    Nothing is said of joints whose range is stated elsewhere.
    """
    narrowed, none, whole = [], [], dict[str, tuple[float, float]]()
    for joint in moving:
        span, soft = tree.span(joint), _soft(tree, joint)
        if span is None or soft is None or joint.name in stated:
            continue
        lower, upper = max(span[0], soft[0]), min(span[1], soft[1])
        if lower >= upper:
            none.append(joint.name)
        elif (lower, upper) != span:
            limit = xml.child(joint.element, "limit", tree.at(joint))
            limit.set("lower", repr(lower))
            limit.set("upper", repr(upper))
            whole[joint.name] = span
            narrowed.append(f"{joint.name} {lower:.4g} to {upper:.4g}{_slowed(tree, joint)}")
    notes = [f"soft limits that leave no range are not used: {listed(none)}"] if none else []
    if narrowed:
        notes.append(
            f"soft limits hold, as drivers enforce them (safety_controller): {listed(narrowed)}; "
            f"{override('limits.position', whole)} has the whole range"
        )
    return notes


def higher(tree: Tree, joint: Joint, kind: str) -> float | None:
    """Limit on acceleration or jerk [rad/s², rad/s³, m/s², m/s³]; None where none above 0 is stated."""
    limit = joint.element.find("limit")
    keys = [] if limit is None else [key for key in limit.attrib if key.rpartition("}")[2] in _NAMES[kind]]
    values = [xml.number(limit, key, tree.at(joint)) for key in keys if limit is not None]
    return min((value for value in values if value > 0), default=None)


def _soft(tree: Tree, joint: Joint) -> tuple[float, float] | None:
    """Soft limits of a joint [rad or m]; None where it has none, an end that is left out being 0."""
    safety = joint.element.find("safety_controller")
    if safety is None:
        return None
    names = "soft_lower_limit", "soft_upper_limit"
    lower, upper = (xml.number(safety, name, tree.at(joint), "0") for name in names)
    return (lower, upper) if lower or upper else None


def _slowed(tree: Tree, joint: Joint) -> str:
    """How far before its soft limits drivers slow a joint down, for people."""
    gain = xml.number(xml.child(joint.element, "safety_controller", ""), "k_position", tree.at(joint), "0")
    velocity = xml.number(xml.child(joint.element, "limit", ""), "velocity", tree.at(joint), "0")
    unit = "m" if joint.kind == "prismatic" else "rad"
    return f" {unit} (slowed down {velocity / gain:.2g} {unit} before)" if gain > 0 < velocity else f" {unit}"
