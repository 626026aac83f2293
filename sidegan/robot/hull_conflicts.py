"""Links whose hulls often touch another link's where no meshes do: hollow ones, which are cut further."""

from collections import Counter
from collections.abc import Sequence
from itertools import combinations

import coal
import numpy as np
import pinocchio as pin

from sidegan.robot.description import Description
from sidegan.robot.fitting import hull_of
from sidegan.robot.shapes import Shape

_MOST, _FEWEST, _QUESTIONS = 1_000, 200, 1_000_000  # configurations, and pairs of hulls in all of them
_SHARE = 0.01  # of the configurations that two links' hulls may refuse though they are free
_OUT = 1.5  # corners are moved outwards by so many radii of what hulls are rounded with


def refused_pairs(
    known: object,
    model: pin.Model,
    geometry: pin.GeometryModel,
    description: Description,
    shapes: Sequence[Shape],
) -> dict[tuple[str, str], float]:
    """Links whose hulls refuse too many random configurations, the same on every call.

    Of each pair the share of free configurations that are refused. For a cache, ``known`` tells scenes apart.
    """
    hulls, owners = _hulls(shapes)
    _pair(hulls, owners, description)
    if not hulls.collisionPairs:
        return {}
    geometry.removeAllCollisionPairs()
    _pair(
        geometry,
        [model.frames[geometry_object.parentFrame].name for geometry_object in geometry.geometryObjects],
        description,
    )
    state, found, meshes = model.createData(), hulls.createData(), geometry.createData()
    for request in meshes.collisionRequests:
        request.enable_contact = True  # else coal 3.0 misses some contacts of cylinders
    links = [(owners[pair.first], owners[pair.second]) for pair in hulls.collisionPairs]
    configurations, alone, free = _sampled(model, description, len(links)), Counter[tuple[str, str]](), 0
    for q in configurations:
        touching = set[tuple[str, str]]()
        if pin.computeCollisions(model, state, hulls, found, q, False):
            touching = {pair for pair, one in zip(links, found.collisionResults) if one.isCollision()}
        if not (touching and pin.computeCollisions(model, state, geometry, meshes, q, True)):
            alone.update(touching)
            free += 1
    often = {pair: times / free for pair, times in alone.items() if times > _SHARE * len(configurations)}
    return dict(sorted(often.items()))


def _hulls(shapes: Sequence[Shape]) -> tuple[pin.GeometryModel, list[str]]:
    """The hulls of fitted shapes, but for flat ones, and the links that they belong to."""
    hulls, owners = pin.GeometryModel(), list[str]()
    for shape in shapes:
        corners = shape.part.corners
        if (hull := hull_of(corners)) is None:
            continue
        out = corners - corners.mean(0)
        out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)
        points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
        points.extend(list(corners + _OUT * shape.part.rounding * out))  # coal rounds no hulls
        triangles.extend([coal.Triangle(*face) for face in hull.simplices.tolist()])
        name, body = str(len(owners)), coal.Convex(points, triangles)
        hulls.addGeometryObject(pin.GeometryObject(name, shape.link + 1, pin.SE3.Identity(), body))
        owners.append(shape.owner)
    return hulls, owners


def _pair(hulls: pin.GeometryModel, owners: Sequence[str], description: Description) -> None:
    """Have hulls of links that are kept apart collide."""
    spared = {frozenset(pair) for *pair, _ in description.may_touch}
    parents = {frozenset(pair) for pair in description.parents}
    for (i, one), (k, other) in combinations(enumerate(hulls.geometryObjects), 2):
        links, between = frozenset((owners[i], owners[k])), abs(one.parentJoint - other.parentJoint)
        if between > (links in parents) and links not in spared:
            hulls.addCollisionPair(pin.CollisionPair(i, k))


def _sampled(model: pin.Model, description: Description, pairs: int) -> np.ndarray:
    """Random configurations within the limits, (N, J)."""
    limits = [description.limits[name] for name in list(model.names)[1:]]
    lower, upper = (np.array([getattr(limit, side) for limit in limits]) for side in ("lower", "upper"))
    count = int(np.clip(_QUESTIONS / pairs, _FEWEST, _MOST))
    return lower + np.random.default_rng(0).random((count, len(limits))) * (upper - lower)
