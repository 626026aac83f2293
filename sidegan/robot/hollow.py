"""Links that are cut into many parts: those whose few hulls often touch another link where no meshes do."""

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from itertools import combinations, product

import coal
import numpy as np
import pinocchio as pin
import scipy  # its parts are imported when they are used

from sidegan.robot.description import Description
from sidegan.robot.shapes import Shape

_MOST, _FEWEST, _QUESTIONS = 1_000, 200, 1_000_000  # configurations, and pairs of hulls in all of them
_SHARE = 0.01  # of the configurations that two links' hulls may refuse though they are free
_OUT = 1.5  # corners are moved outwards by so many radii of what hulls are rounded with

Links = tuple[str, str]


def hollow_links(
    model: pin.Model, geometry: pin.GeometryModel, description: Description, shapes: Sequence[Shape]
) -> list[str]:
    """Links whose hulls refuse too many random configurations, the same on every call.

    Args:
        model: of the chain.
        geometry: its collision shapes, as Pinocchio read them.
        description: of the same arm.
        shapes: with few parts for each link.
    """
    hulls, owners = _hulls(shapes)
    _pair(hulls, owners, description)
    if not hulls.collisionPairs:
        return []
    meshes: dict[str, list[int]] = {}
    for k, one in enumerate(geometry.geometryObjects):
        meshes.setdefault(model.frames[one.parentFrame].name, []).append(k)
    links = [(owners[pair.first], owners[pair.second]) for pair in hulls.collisionPairs]
    state, found, places = model.createData(), hulls.createData(), geometry.createData()
    configurations, alone = _sampled(model, description, len(links)), Counter[Links]()
    for q in configurations:
        if pin.computeCollisions(model, state, hulls, found, q, False):
            pin.updateGeometryPlacements(model, state, geometry, places)
            touching = {pair for pair, one in zip(links, found.collisionResults) if one.isCollision()}
            if not any(_hit(geometry, places, meshes[one], meshes[other]) for one, other in touching):
                alone.update(touching)
    often = [pair for pair, times in alone.items() if times > _SHARE * len(configurations)]
    return sorted({name for pair in often for name in pair})


def _hulls(shapes: Sequence[Shape]) -> tuple[pin.GeometryModel, list[str]]:
    """The hulls of fitted shapes, but for flat ones, and the links that they belong to."""
    hulls, owners = pin.GeometryModel(), list[str]()
    for shape in shapes:
        with suppress(scipy.spatial.QhullError, ValueError):
            corners = shape.part.corners
            faces = scipy.spatial.ConvexHull(corners).simplices.tolist()
            out = corners - corners.mean(0)
            out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)
            points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
            points.extend(list(corners + _OUT * shape.part.rounding * out))  # coal rounds no hulls
            triangles.extend([coal.Triangle(*face) for face in faces])
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
    lower, upper = (np.array([getattr(one, side) for one in limits]) for side in ("lower", "upper"))
    count = int(np.clip(_QUESTIONS / pairs, _FEWEST, _MOST))
    return lower + np.random.default_rng(0).random((count, len(limits))) * (upper - lower)


def _hit(
    geometry: pin.GeometryModel, places: pin.GeometryData, some: Sequence[int], others: Sequence[int]
) -> bool:
    """Whether shapes collide with others where they are."""
    request = coal.CollisionRequest(coal.CONTACT, 1)  # without contacts coal 3.0 misses some of cylinders
    at = {k: coal.Transform3s(places.oMg[k].rotation, places.oMg[k].translation) for k in (*some, *others)}
    bodies = [one.geometry for one in geometry.geometryObjects]
    return any(
        coal.collide(bodies[i], at[i], bodies[k], at[k], request, coal.CollisionResult())
        for i, k in product(some, others)
    )
