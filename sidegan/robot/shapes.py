"""Collision shapes of the links: capsules that enclose them, and convex pieces that enclose them tightly."""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
import scipy  # submodules load lazily

from sidegan.base.progress import bar
from sidegan.robot.arm import Capsules, rounded
from sidegan.robot.covering import ConvexPart, cover_of
from sidegan.robot.fitting import Points, around, ends_along, hull_volume, inflated

VERSION = 7  # raise it when a change yields other shapes for the same description

_SIDES = 64  # of the prism circumscribed about a cylinder


class Shape(NamedTuple):
    """A capsule and the body inside, in the frame of the joint that moves them."""

    link: int  # that joint; -1 for the base
    owner: str  # the description's link
    part: ConvexPart
    exact: bool = False  # whether the capsule is the shape itself
    digest: str = ""  # of the meshes it was fitted to, and their placement


def link_shapes(
    geometry: pin.GeometryModel, model: pin.Model, hollow: Mapping[str, int] | None = None
) -> list[Shape]:
    """Collision shapes of a description, with all meshes of a link taken together.

    ``hollow`` has links that are divided into more parts, at level 1, 2 or 3.
    """
    groups: dict[tuple[str, str], list[pin.GeometryObject]] = {}
    for geometry_object in geometry.geometryObjects:
        owner = model.frames[geometry_object.parentFrame].name
        groups.setdefault((owner, "" if is_mesh(geometry_object) else geometry_object.name), []).append(
            geometry_object
        )
    shapes = []
    with bar("fitting collision shapes to links", len(groups)) as progress:
        for done, ((owner, primitive), group) in enumerate(groups.items()):
            progress(done)
            link = group[0].parentJoint - 1
            if primitive:
                exact = isinstance(group[0].geometry, coal.Capsule | coal.Sphere)
                shapes.append(Shape(link, owner, _placed(_primitive(group[0].geometry), group[0]), exact))
            else:
                parts, digest = _fitted(group, (hollow or {}).get(owner, 0))
                shapes += [Shape(link, owner, _placed(part, group[0]), digest=digest) for part in parts]
    return shapes


def capsules_of(shapes: Sequence[Shape]) -> Capsules:
    """All shapes as arrays."""
    ends = np.array([shape.part.capsule[0] for shape in shapes], dtype=np.float64).reshape(-1, 2, 3)
    corners = [shape.part.corners for shape in shapes]
    return Capsules(
        link=np.array([shape.link for shape in shapes], dtype=int),
        a=ends[:, 0].copy(),
        b=ends[:, 1].copy(),
        radius=np.array([shape.part.capsule[1] for shape in shapes]),
        owners=tuple(shape.owner for shape in shapes),
        corners=np.concatenate([np.zeros((0, 3)), *corners]),
        start=np.cumsum([0, *map(len, corners)]),
        rounding=np.array([shape.part.rounding for shape in shapes]),
        core=np.array([_core(shape) for shape in shapes]),
        exact=np.array([shape.exact for shape in shapes], dtype=bool),
        fitted=np.array([bool(shape.digest) for shape in shapes], dtype=bool),
    )


def _core(shape: Shape) -> float:
    """Radius [m] of a capsule on the same axis with the piece's volume."""
    (ends, radius), corners, rounding = shape.part
    if shape.exact:
        return radius
    length = float(np.linalg.norm(ends[1] - ends[0]))
    roots = np.roots([4 / 3 * np.pi, np.pi * length, 0.0, -hull_volume(corners)])
    return max(min(float(roots.real.max()), radius), rounding)


def _placed(part: ConvexPart, shape: pin.GeometryObject) -> ConvexPart:
    """A part of a shape, in the frame of the joint that moves it."""
    (ends, radius), corners, rounding = part
    turn = shape.placement.rotation.T
    place = shape.placement.translation
    return ConvexPart((ends @ turn + place, radius), corners @ turn + place, rounding)


def _primitive(shape: coal.CollisionGeometry) -> ConvexPart:
    """A primitive shape of the description, in its own frame.

    The inflated hull is the shape itself, apart from a cylinder's facets. Axes of capsules around cylinders
    and boxes do not depend on rounding, so that digests are the same on every machine.
    """
    match shape:
        case coal.Sphere():
            return ConvexPart((np.zeros((2, 3)), shape.radius), np.zeros((2, 3)), shape.radius)
        case coal.Capsule():
            ends = np.outer([-shape.halfLength, shape.halfLength], [0.0, 0.0, 1.0])
            return ConvexPart((ends, shape.radius), ends, shape.radius)
        case coal.Cylinder():
            axis = 2
            angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
            rim = shape.radius / np.cos(np.pi / _SIDES) * np.stack([np.cos(angle), np.sin(angle)], 1)
            heights = (-shape.halfLength, shape.halfLength)
            corners = np.concatenate([np.c_[rim, np.full(_SIDES, z)] for z in heights])
        case _:
            axis = int(np.argmax(shape.halfSide))
            corners = inflated(np.zeros((1, 3)), 1.0) * shape.halfSide
    return ConvexPart(around(ends_along(corners, np.eye(3)[axis]), corners), corners, 0.0)


def is_mesh(shape: pin.GeometryObject) -> bool:
    """Whether a shape is a mesh."""
    return bool(shape.meshPath) and isinstance(shape.geometry, coal.BVHModelBase | coal.ConvexBase)


def _fitted(group: list[pin.GeometryObject], hollow: int) -> tuple[list[ConvexPart], str]:
    """Capsules and hulls around the meshes of a link, in the first mesh's frame, and the meshes' digest."""
    first = group[0].placement
    placed = [(mesh, first.actInv(mesh.placement)) for mesh in group]
    state = hashlib.sha256(str(VERSION).encode())
    for mesh, place in placed:
        state.update(hashlib.sha256(Path(mesh.meshPath).read_bytes()).digest())
        state.update(rounded(np.r_[mesh.meshScale, place.rotation.ravel(), place.translation]))

    def triangles() -> list[Points]:
        parts = [_triangles(mesh.geometry) @ place.rotation.T + place.translation for mesh, place in placed]
        return [part for part in parts if len(part)]

    parts = cover_of(state.hexdigest(), hollow, triangles)
    where = hashlib.sha256(rounded(np.r_[first.rotation.ravel(), first.translation])).hexdigest()
    return parts, f"{state.hexdigest()} {where} {group[0].parentJoint}"


def _triangles(shape: coal.CollisionGeometry) -> Points:
    """Corners of a mesh's triangles [m], (N, 3, 3)."""
    if isinstance(shape, coal.ConvexBase):
        vertices = np.array(shape.points(), dtype=np.float64)
        return vertices[scipy.spatial.ConvexHull(vertices).simplices]
    indices = [[t[0], t[1], t[2]] for t in (shape.tri_indices(i) for i in range(shape.num_tris))]
    return np.array(shape.vertices(), dtype=np.float64)[np.array(indices, dtype=int).reshape(-1, 3)]
