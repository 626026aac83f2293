"""What an arm stands on: the lowest point of its fixed links, and whose it is."""

import xml.etree.ElementTree as ET
from functools import lru_cache

import numpy as np
import pinocchio as pin

from sidegan.base.arrays import Array
from sidegan.robot.arm import Arm
from sidegan.robot.sources import read_source
from sidegan.robot.tree import UrdfJoint, read_tree
from sidegan.robot.visuals import links_with_frames, read_surface

_FLAT = 1e-3  # [m] from z = 0 within which points belong to a foot


@lru_cache(maxsize=16)
def foot(arm: Arm) -> tuple[float, bool, str]:
    """Lowest point of the fixed links [m], whether it is known, and the link that has it.

    A link ends at its visual shapes or its collision meshes, whichever end higher. Collision primitives only
    approximate a link, so z = 0 is assumed if they extend below it. Plugs and cables that hang beside a foot
    around the origin are ignored.
    """
    found = []
    for link, frame in links_with_frames(arm):
        solid, shown = link.findall("collision"), link.findall("visual")
        if frame.parentJoint or not (solid or shown):
            continue
        name = frame.name
        meshes = [shape for shape in solid if shape.find("geometry/mesh") is not None]
        if spans := [span for shapes in (shown, meshes) if (span := _span(arm, shapes, frame))]:
            found.append((max(low for low, _ in spans), True, name))
            continue
        low, high = _span(arm, [shape for shape in solid if shape not in meshes], frame) or (0.0, 0.0)
        found.append((0.0 if low < 0 < high else low, False, name))
    return min(found, default=(0.0, False, ""))


def like_the_arm(arm: Arm, link: str) -> bool:
    """Whether a link belongs to another limb with the same kinds of joints as the arm, as another leg."""
    tree = read_tree(read_source(arm.urdf, arm.setup.args).root, str(arm.urdf))
    own = [joint for joint in tree.path(link) if joint.kind != "fixed"]
    arms = [joint for joint in tree.path(arm.link_names[-1]) if joint.kind != "fixed"]

    def carried(first: UrdfJoint) -> list[str]:
        return sorted(other.kind for other in tree.joints.values() if first in tree.path(other.child))

    branches = [(mine, other) for mine, other in zip(own, arms) if mine is not other]
    return bool(branches) and carried(branches[0][0]) == carried(branches[0][1])


def _span(arm: Arm, shapes: list[ET.Element], frame: pin.Frame) -> tuple[float, float] | None:
    """Lowest and highest point [m] of shapes; None if there are none or one is unreadable.

    The lowest is z = 0 if points there enclose the origin and all points below are on one side of it.
    """
    try:
        points = np.concatenate([read_surface(arm, shape, frame).vertices for shape in shapes])
        heights = points[:, 2]
        low, high = float(heights.min()), float(heights.max())
        at, below = points[np.abs(heights) <= _FLAT, :2], points[heights < -_FLAT, :2]
        return (0.0 if low < -_FLAT and _encloses(at) and not _encloses(below) else low), high
    except Exception:  # mesh readers raise all kinds of errors
        return None


def _encloses(points: Array) -> bool:
    """Whether points (N, 2) surround the origin: no gap between their directions is half a turn."""
    angles = np.sort(np.arctan2(points[:, 1], points[:, 0]))
    return len(angles) > 2 and bool(np.diff(angles, append=angles[0] + 2 * np.pi).max() < np.pi)
