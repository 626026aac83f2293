"""Collision geometry of an arm, refined where hulls of hollow links collide although their meshes do not."""

from collections import Counter
from collections.abc import Sequence
from itertools import combinations

import coal
import numpy as np
import pinocchio as pin

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.errors import RobotError
from sidegan.robot.description import Description
from sidegan.robot.fitting import hull_of
from sidegan.robot.meshes import cache_folder
from sidegan.robot.model import pinocchio_errors
from sidegan.robot.shapes import Shape, is_mesh, link_shapes
from sidegan.robot.thresholds import FALSE_COLLISIONS, LARGE_AT_LEAST, LARGE_BASE, LARGE_SHAPE, SMALL_MESH

_MOST, _FEWEST = 1_000, 200  # configurations
_QUESTIONS = 1_000_000  # tests of pairs of hulls in all configurations together
_OUT = 1.5  # rounding radii by which a hull's corners are moved outwards, in place of inflating it


def collision_shapes(
    model: pin.Model, description: Description, length: float
) -> tuple[list[Shape], dict[tuple[str, str], float]]:
    """Collision shapes of the links as capsules with bodies inside, and pairs of links with false collisions.

    For each such pair, the share of free configurations that it rules out. Shapes far too large or small for
    an arm of this length [m] are refused.
    """
    with pinocchio_errors(description):
        geometry = pin.buildGeomFromUrdfString(model, description.xml, pin.GeometryType.COLLISION)
    _refuse_other_orders(model, geometry, description, length)
    shapes = link_shapes(geometry, model)
    if not any(shape.digest for shape in shapes):
        return shapes, {}
    from joblib import Memory

    scene = {"model": model, "geometry": geometry, "description": description}
    known = description.xml, description.may_touch, [shape.digest for shape in shapes]
    refused = Memory(cache_folder(), verbose=0).cache(_refused_pairs, ignore=[*scene, "shapes"])
    hollow: dict[str, int] = {}
    often = refused(known=(known, hollow), shapes=shapes, **scene)
    for level in (1, 2, 3):
        if often:
            finer = hollow | {link: level for pair in often for link in pair}
            tried = link_shapes(geometry, model, finer)
            left = refused(known=(known, finer), shapes=tried, **scene)
            if sum(left.values()) < sum(often.values()):
                hollow, shapes, often = finer, tried, left
    return shapes, often


def _refuse_other_orders(
    model: pin.Model, geometry: pin.GeometryModel, description: Description, length: float
) -> None:
    """Refuse shapes far too large or small for an arm of this length [m]."""
    wrong: dict[str, str] = {}
    for geometry_object in geometry.geometryObjects:
        geometry_object.geometry.computeLocalAABB()
        size = 2 * float(geometry_object.geometry.aabb_radius)
        if why := of_another_order(size, length, bool(geometry_object.parentJoint), is_mesh(geometry_object)):
            wrong.setdefault(model.frames[geometry_object.parentFrame].name, why)
    if wrong:
        shapes = listed([f"{link} {why}" for link, why in wrong.items()], 4)
        raise RobotError(
            f"{description.path}: shapes far too large or small for an arm of {length:.2g} m: {shapes}; "
            'the scale of a mesh is in metres per unit of its file, such as scale="0.001 0.001 0.001"'
        )


def of_another_order(size: float, length: float, moves: bool, mesh: bool) -> str:
    """Why a shape of this size [m] cannot belong to an arm of this length [m]; empty if it can.

    Fixed meshes may be as large as a room; fixed primitives may be anything, such as a floor or a marker.
    """
    if not (moves or mesh):
        return ""
    if size > max(LARGE_AT_LEAST, (LARGE_SHAPE if moves else LARGE_BASE) * length):
        return f"{size:.2g} m across (in millimetres?)"
    if mesh and moves and size < SMALL_MESH * length:
        return f"{size:.2g} m across (scaled from millimetres twice?)"
    return ""


def _refused_pairs(
    known: object,
    model: pin.Model,
    geometry: pin.GeometryModel,
    description: Description,
    shapes: Sequence[Shape],
) -> dict[tuple[str, str], float]:
    """Pairs of links whose hulls touch in many configurations that are free by their meshes, with the share.

    Configurations are random, and the same on every call. A cache of results tells scenes apart by ``known``.
    """
    hulls = _hulls(shapes, model)
    links = _pair(hulls, model, description)
    if not links:
        return {}
    geometry.removeAllCollisionPairs()
    _pair(geometry, model, description)
    state, found, meshes = model.createData(), hulls.createData(), geometry.createData()
    for request in meshes.collisionRequests:
        request.enable_contact = True  # else coal 3.0 misses some contacts of cylinders
    configurations, alone, free = _sampled(model, len(links)), Counter[tuple[str, str]](), 0
    for q in configurations:
        touching = set[tuple[str, str]]()
        if pin.computeCollisions(model, state, hulls, found, q, False):
            touching = {pair for pair, one in zip(links, found.collisionResults) if one.isCollision()}
        if not (touching and pin.computeCollisions(model, state, geometry, meshes, q, True)):
            alone.update(touching)
            free += 1
    enough = FALSE_COLLISIONS * len(configurations)
    return {pair: times / free for pair, times in sorted(alone.items()) if times > enough}


def _hulls(shapes: Sequence[Shape], model: pin.Model) -> pin.GeometryModel:
    """Hulls of all shapes that are not flat."""
    hulls = pin.GeometryModel()
    for k, shape in enumerate(shapes):
        corners = shape.part.corners
        if (hull := hull_of(corners)) is None:
            continue
        out = corners - corners.mean(0)
        out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)
        points = coal.StdVec_Vec3s()
        triangles = coal.StdVec_Triangle()
        points.extend(list(corners + _OUT * shape.part.rounding * out))  # coal cannot inflate hulls
        triangles.extend([coal.Triangle(*face) for face in hull.simplices.tolist()])
        frame = model.getFrameId(shape.owner, pin.FrameType.BODY)
        body = coal.Convex(points, triangles)
        hulls.addGeometryObject(pin.GeometryObject(str(k), shape.link + 1, frame, pin.SE3.Identity(), body))
    return hulls


def _pair(geometry: pin.GeometryModel, model: pin.Model, description: Description) -> list[tuple[str, str]]:
    """Register collision pairs of all links that must not touch; these links, pair by pair."""
    spared = {frozenset(pair) for *pair, _ in description.may_touch}
    parents = {frozenset(pair) for pair in description.parents}
    owners = [model.frames[geometry_object.parentFrame].name for geometry_object in geometry.geometryObjects]
    paired = []
    for (i, a), (k, b) in combinations(enumerate(geometry.geometryObjects), 2):
        links = owners[i], owners[k]
        between = abs(a.parentJoint - b.parentJoint)
        if between > (frozenset(links) in parents) and frozenset(links) not in spared:
            geometry.addCollisionPair(pin.CollisionPair(i, k))
            paired.append(links)
    return paired


def _sampled(model: pin.Model, pairs: int) -> Array:
    """Random configurations within the limits, (N, J)."""
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    count = int(np.clip(_QUESTIONS / pairs, _FEWEST, _MOST))
    return lower + np.random.default_rng(0).random((count, model.nq)) * (upper - lower)
