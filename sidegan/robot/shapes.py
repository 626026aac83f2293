"""Collision shapes of the links: capsules that hold them, and convex pieces that hold them more tightly."""

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import scipy  # its parts are imported when they are used
import torch

from sidegan.robot.arm import Capsules, Pieces
from sidegan.robot.capsule_fit import hull_volume, volume
from sidegan.robot.covers import Cover, cover_of
from sidegan.robot.enclosing import Points, Segment, around_cylinder, around_points

PIECES_VERSION = 2  # raise it when what is inside of capsules of sizes becomes something else

NONE: Mapping[str, int] = {}
_SIDES = 64  # of the prism around a cylinder, whose faces touch it
_HALVINGS = 40  # of an interval that a radius is in
_FINEST = 2.0**40  # steps per metre of a placement in a digest, as in digests of arms


@dataclass(frozen=True)
class Shape:
    """One or several capsules with what is inside of each, in the frame of the joint that moves them."""

    link: int  # that joint; -1 for the base
    owner: str  # the link of the description
    name: str
    segments: tuple[Segment, ...]
    corners: tuple[Points, ...]  # of the hull in each capsule [m], (V, 3); its ends where it is the shape
    rounding: tuple[float, ...]  # radius of the ball that is added to each hull [m]
    exact: bool  # whether the capsule is the shape
    digest: str = ""  # of the meshes it was fitted to, and where they are


def shapes_of(
    geometry: pin.GeometryModel, model: pin.Model, pieces: int, further: Mapping[str, int] = NONE
) -> list[Shape]:
    """The collision shapes of a description, those made of meshes link by link.

    Args:
        geometry: the shapes as Pinocchio read them.
        model: the chain of links.
        pieces: into how many parts a link's meshes are cut at most.
        further: into how many these are cut then, by link.
    """
    groups: dict[str, list[pin.GeometryObject]] = {}
    for one in geometry.geometryObjects:
        owner = model.frames[one.parentFrame].name
        key = f"{owner} meshes" if is_mesh(one) else one.name
        groups.setdefault(key, []).append(one)
    owners = [model.frames[group[0].parentFrame].name for group in groups.values()]
    count = Counter(owners)
    shapes = []
    for owner, group in zip(owners, groups.values()):
        name = owner if count[owner] == 1 else group[0].name
        if is_mesh(group[0]):
            shape = _fitted(group, owner, pieces, further.get(owner, 0))
        else:
            shape = _primitive(group[0], owner)
        shapes.append(replace(shape, name=name))
    return shapes


def capsules_of(shapes: Sequence[Shape]) -> Capsules:
    """All shapes side by side, as tensors."""
    rows = [(shape, k) for shape in shapes for k in range(len(shape.segments))]
    segments = [shape.segments[k] for shape, k in rows]
    ends = np.array([segment[0] for segment in segments], dtype=np.float64).reshape(-1, 2, 3)
    return Capsules(
        link=torch.tensor([shape.link for shape, _ in rows], dtype=torch.long),
        a=torch.from_numpy(ends[:, 0].copy()),
        b=torch.from_numpy(ends[:, 1].copy()),
        radius=torch.tensor([radius for _, radius in segments], dtype=torch.float64),
        names=tuple(shape.name for shape, _ in rows),
        owners=tuple(shape.owner for shape, _ in rows),
        pieces=None if all(shape.exact for shape in shapes) else _pieces(rows),
    )


def _pieces(rows: list[tuple[Shape, int]]) -> Pieces:
    corners = [shape.corners[k] for shape, k in rows]
    starts = np.cumsum([0, *map(len, corners)])
    return Pieces(
        corners=torch.from_numpy(np.concatenate(corners)),
        start=torch.from_numpy(starts),
        radius=torch.tensor([shape.rounding[k] for shape, k in rows], dtype=torch.float64),
        exact=torch.tensor([shape.exact for shape, _ in rows]),
        fitted=torch.tensor([bool(shape.digest) for shape, _ in rows]),
        core=torch.tensor([_core(shape, k) for shape, k in rows], dtype=torch.float64),
        digests=tuple(shape.digest for shape, _ in rows),
    )


def _core(shape: Shape, k: int) -> float:
    """Radius [m] of a capsule on the same axis, of the same volume as the piece."""
    ends, radius = shape.segments[k]
    if shape.exact:
        return radius
    size = hull_volume(shape.corners[k])
    low, high = 0.0, radius
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if volume((ends, middle)) < size else (low, middle)
    return max(high, shape.rounding[k])


def is_mesh(one: pin.GeometryObject) -> bool:
    """Whether a shape is one of triangles."""
    return bool(one.meshPath) and isinstance(one.geometry, coal.BVHModelBase | coal.ConvexBase)


def _primitive(one: pin.GeometryObject, owner: str) -> Shape:
    """A shape that the description gives by its sizes."""
    local, radius = _enclose(one.geometry)
    place, turn = one.placement.translation, one.placement.rotation
    ends = local @ turn.T + place
    exact = isinstance(one.geometry, coal.Capsule | coal.Sphere)
    corners = ends if exact else _corners(one.geometry) @ turn.T + place
    rounding = radius if exact else 0.0
    return Shape(one.parentJoint - 1, owner, one.name, ((ends, radius),), (corners,), (rounding,), exact)


def _enclose(shape: coal.CollisionGeometry) -> Segment:
    """End points, (2, 3), and radius of a capsule around a shape, in the shape's own frame."""
    match shape:
        case coal.Capsule():
            return np.array([[0.0, 0.0, -shape.halfLength], [0.0, 0.0, shape.halfLength]]), shape.radius
        case coal.Sphere():
            return np.zeros((2, 3)), shape.radius
        case coal.Cylinder():
            return around_cylinder(shape.radius, shape.halfLength)
    return around_points(_corners(shape))


def _corners(shape: coal.CollisionGeometry) -> Points:
    """Corners of a convex body, (V, 3), that holds a shape: the shape itself but for a cylinder's facets."""
    match shape:
        case coal.Box():
            return np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T * shape.halfSide
        case coal.Cylinder():
            angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
            rim = shape.radius / np.cos(np.pi / _SIDES) * np.stack([np.cos(angle), np.sin(angle)], 1)
            half = shape.halfLength
            return np.concatenate([np.c_[rim, np.full(_SIDES, z)] for z in (-half, half)])
    return vertices_of(shape)


def vertices_of(shape: coal.CollisionGeometry) -> Points:
    """Vertices of a mesh, (V, 3)."""
    points = shape.points() if isinstance(shape, coal.ConvexBase) else shape.vertices()
    return np.array(points, dtype=np.float64)


class MeshGroup:
    """The meshes of one link, in the frame of the first of them."""

    def __init__(self, group: list[pin.GeometryObject]) -> None:
        self.group = group

    @cached_property
    def triangles(self) -> list[Points]:
        """Corners of the triangles of each mesh that has some [m], (N, 3, 3)."""
        first = self.group[0].placement
        parts = []
        for one in self.group:
            relative = first.actInv(one.placement)
            parts.append(_triangles(one.geometry) @ relative.rotation.T + relative.translation)
        return [part for part in parts if len(part)]

    @cached_property
    def digest(self) -> str:
        """Sha256 (hex) of the files, with their scale and place; the same on every machine."""
        state = hashlib.sha256()
        for one in self.group:
            relative = self.group[0].placement.actInv(one.placement)
            state.update(hashlib.sha256(Path(one.meshPath).read_bytes()).digest())
            state.update(_rounded(np.r_[one.meshScale, relative.rotation.ravel(), relative.translation]))
        return state.hexdigest()


def _fitted(group: list[pin.GeometryObject], owner: str, pieces: int, further: int) -> Shape:
    """Capsules and hulls around the meshes of a link."""
    meshes, placement = MeshGroup(group), group[0].placement
    cover: Cover = cover_of(meshes.digest, len(group), lambda: meshes.triangles, pieces, further)
    where = hashlib.sha256(_rounded(np.r_[placement.rotation.ravel(), placement.translation])).hexdigest()

    def placed(points: Points) -> Points:
        return points @ placement.rotation.T + placement.translation

    return Shape(
        link=group[0].parentJoint - 1,
        owner=owner,
        name=owner,
        segments=tuple((placed(ends), radius) for ends, radius in cover.segments),
        corners=tuple(placed(corners) for corners in cover.corners),
        rounding=cover.rounding,
        exact=False,
        digest=f"{cover.digest} {where} {group[0].parentJoint}",
    )


def _triangles(shape: coal.CollisionGeometry) -> Points:
    """Corners of a mesh's triangles [m], (N, 3, 3)."""
    vertices = vertices_of(shape)
    if isinstance(shape, coal.ConvexBase):
        return vertices[scipy.spatial.ConvexHull(vertices).simplices]
    indices = [[t[0], t[1], t[2]] for t in (shape.tri_indices(i) for i in range(shape.num_tris))]
    return vertices[np.array(indices, dtype=int).reshape(-1, 3)]


def _rounded(numbers: Points) -> bytes:
    """Numbers as bytes that rounding errors do not change."""
    return (np.round(numbers * _FINEST) / _FINEST + 0.0).astype("<f8").tobytes()
