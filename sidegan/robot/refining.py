"""Which links are cut into more pieces: those whose hulls collide often where their meshes are apart."""

import hashlib
import json
import logging
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product

import coal
import numpy as np
import pinocchio as pin
import scipy  # its parts are imported when they are used

from sidegan.base.storage import write_bytes
from sidegan.errors import StorageError
from sidegan.robot.covers import cache_folder
from sidegan.robot.description import Description
from sidegan.robot.enclosing import Points
from sidegan.robot.shapes import Shape, is_mesh, shapes_of

VERSION = 3  # raise it when other links are cut further

_MOST, _FEWEST = 3_000, 300  # random configurations; fewer where there are many pairs of pieces
_QUESTIONS = 4_000_000  # pairs of pieces that are looked at in all of them together
_SHARE = 3e-3  # of the free configurations that hulls may refuse
_BLAMED = 5e-4  # of all configurations for which a link may be to blame
_JUDGED = 300  # refused configurations that are looked into, at most
_ROUND = 1.5  # corners are moved outwards by so many radii of what hulls are rounded with
_log = logging.getLogger(__name__)

Links = tuple[str, str]


@dataclass(frozen=True)
class Refining:
    """The search for the links of a chain that have to be cut into more pieces.

    Random configurations, the same on every call, in which hulls collide and no meshes do tell whose hull is
    too large: the one that the other link's mesh collides with. Such links get twice as many pieces, again
    and again, until hardly any free configuration is refused.
    """

    model: pin.Model
    geometry: pin.GeometryModel  # the collision shapes, as Pinocchio read them
    description: Description  # of the same arm
    pieces: int  # into which a link's meshes are cut at first, at most
    most: int  # into which they are cut where that is not enough, at most

    def run(self, shapes: Sequence[Shape]) -> dict[str, int]:
        """Into how many pieces the meshes of some links are cut; from the cache where it is there.

        Args:
            shapes: of all links, with as many pieces as they have at first.
        """
        if self.most <= self.pieces or not any(shape.digest for shape in shapes):
            return {}
        file = cache_folder() / "refined" / f"{self._key(shapes)}.json"
        with suppress(OSError, ValueError, AttributeError):
            return {str(name): int(count) for name, count in json.loads(file.read_text("utf-8")).items()}
        found = self._search(shapes)
        with suppress(StorageError):  # a folder that cannot be written: the work is done again next time
            write_bytes(file, json.dumps(found).encode())
        return found

    def _key(self, shapes: Sequence[Shape]) -> str:
        """What the search depends on."""
        limits = {name: (one.lower, one.upper) for name, one in self.description.limits.items()}
        named = sorted(self.description.may_touch)
        parts = (VERSION, self.most, self.description.xml, limits, named, [one.digest for one in shapes])
        return hashlib.sha256(repr(parts).encode()).hexdigest()

    def _search(self, shapes: Sequence[Shape]) -> dict[str, int]:
        counts = {shape.owner: self.pieces for shape in shapes if shape.digest}
        scene = _Scene(self, shapes)
        q = self._sampled(scene.pairs)
        wrong, free = scene.refused(q)
        while len(wrong) > _SHARE * free:
            blamed = scene.blamed(q, wrong[:_JUDGED])
            enough = max(1.0, _BLAMED * len(q) * min(1.0, _JUDGED / len(wrong)))
            more = {name for name, times in blamed.items() if times > enough and counts[name] < self.most}
            if not more:
                break
            counts |= {name: min(2 * counts[name], self.most) for name in more}
            _log.info(
                "cutting more finely: %s", ", ".join(f"{name} ({counts[name]})" for name in sorted(more))
            )
            scene = _Scene(self, shapes_of(self.geometry, self.model, self.pieces, self._further(counts)))
            still, _ = scene.refused(q[wrong])
            wrong = [wrong[k] for k in still]
        return self._further(counts)

    def _further(self, counts: dict[str, int]) -> dict[str, int]:
        return {name: count for name, count in counts.items() if count > self.pieces}

    def _sampled(self, pairs: int) -> Points:
        """Random configurations within the limits, (N, J)."""
        limits = [self.description.limits[name] for name in list(self.model.names)[1:]]
        count = int(np.clip(_QUESTIONS / max(1, pairs), _FEWEST, _MOST))
        lower, upper = (np.array([getattr(one, side) for one in limits]) for side in ("lower", "upper"))
        return lower + np.random.default_rng(0).random((count, len(limits))) * (upper - lower)


class _Scene:
    """An arm's own shapes, and beside them the convex pieces that stand for its meshes."""

    def __init__(self, refining: Refining, shapes: Sequence[Shape]) -> None:
        self.model, description = refining.model, refining.description
        self.geometry = refining.geometry.copy()
        self.geometry.removeAllCollisionPairs()
        objects = self.geometry.geometryObjects
        owners = [self.model.frames[one.parentFrame].name for one in objects]
        self.meshes = {name: [k for k, own in enumerate(owners) if own == name] for name in owners}
        self.hulls = {
            name: [k for k in rows if not is_mesh(objects[k])] for name, rows in self.meshes.items()
        }
        for shape in shapes:
            for corners, rounding in zip(shape.corners, shape.rounding) if shape.digest else ():
                self._add(shape, corners, rounding)
        self.fitted = {shape.owner for shape in shapes if shape.digest}
        spared = {frozenset(pair) for *pair, _ in description.may_touch}
        parents = {frozenset(pair) for pair in description.parents}
        for pair in combinations(self.hulls, 2):
            if frozenset(pair) in spared:
                continue
            for i, k in product(*(self.hulls[name] for name in pair)):
                between = abs(objects[i].parentJoint - objects[k].parentJoint)
                if between > 1 or (between == 1 and frozenset(pair) not in parents):
                    self.geometry.addCollisionPair(pin.CollisionPair(i, k))
        self.owners = {k: name for name, rows in self.hulls.items() for k in rows}
        self.state, self.found = self.model.createData(), self.geometry.createData()

    def _add(self, shape: Shape, corners: Points, rounding: float) -> None:
        """Add a piece; flat ones, which hold little that the mesh does not, are left out."""
        with suppress(scipy.spatial.QhullError, ValueError):
            out = corners - corners.mean(0)
            out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)
            points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
            points.extend(list(corners + _ROUND * rounding * out))  # coal takes no rounded hulls near meshes
            triangles.extend(
                [coal.Triangle(*face) for face in scipy.spatial.ConvexHull(corners).simplices.tolist()]
            )
            body = coal.Convex(points, triangles)
            name = f"piece {self.geometry.ngeoms}"
            one = pin.GeometryObject(name, shape.link + 1, 0, pin.SE3.Identity(), body)
            self.hulls[shape.owner].append(self.geometry.addGeometryObject(one))

    @property
    def pairs(self) -> int:
        """Number of pairs of pieces."""
        return len(self.geometry.collisionPairs)

    @cached_property
    def _links(self) -> list[Links]:
        """The links of each pair."""
        return [(self.owners[one.first], self.owners[one.second]) for one in self.geometry.collisionPairs]

    def _touching(self, q: Points) -> list[Links]:
        """Links whose pieces collide at a position (J,)."""
        if not pin.computeCollisions(self.model, self.state, self.geometry, self.found, q, False):
            return []
        results = self.found.collisionResults
        return list(dict.fromkeys(pair for pair, one in zip(self._links, results) if one.isCollision()))

    def refused(self, q: Points) -> tuple[list[int], int]:
        """Rows of positions (N, J) where pieces collide and no meshes do, and how many rows are free."""
        wrong, free = [], len(q)
        for row, x in enumerate(q):
            touching = self._touching(x)
            if any(self._hit(self.meshes[one], self.meshes[other]) for one, other in touching):
                free -= 1
            elif touching:
                wrong.append(row)
        return wrong, free

    def blamed(self, q: Points, rows: Iterable[int]) -> Counter[str]:
        """In how many rows the pieces of which link are in the way of another one's mesh; else of both."""
        blamed = Counter[str]()
        for row in rows:
            guilty = set[str]()
            for one, other in self._touching(q[row]):
                ways = ((one, other), (other, one))
                found = {a for a, b in ways if self._hit(self.hulls[a], self.meshes[b])} & self.fitted
                guilty |= found or ({one, other} & self.fitted)
            blamed.update(guilty)
        return blamed

    def _hit(self, some: Iterable[int], others: Sequence[int]) -> bool:
        """Whether shapes collide with others where they are."""
        objects, places = self.geometry.geometryObjects, self.found.oMg
        request = coal.CollisionRequest(coal.CONTACT, 1)  # without contacts coal 3.0 misses some of cylinders
        at = {k: coal.Transform3s(places[k].rotation, places[k].translation) for k in (*some, *others)}
        return any(
            coal.collide(
                objects[i].geometry, at[i], objects[k].geometry, at[k], request, coal.CollisionResult()
            )
            for i, k in product(some, others)
        )
