"""The command ``python -m benchmarks.independent URDF FOLDER``: are trajectories what they claim to be?

Nothing of sidegan takes part: Pinocchio and coal read the description with its original meshes, and the
trajectories are CSV files (time, q_…, dq_…, ddq_…). Every sample is checked: position, velocity and effort,
acceleration and jerk where limits are given, self-collision, the floor, planes and boxes. What the
description does not say stands in a JSON file of facts: where other joints stand, which links may touch,
what is around.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pandas as pd
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

Numbers = NDArray[np.float64]

_ROUNDING = 1e-6  # share of a limit by which written numbers may exceed it
_CONSISTENT = 1e-3  # largest difference between a rate and its integral's, as a share of the largest rate


@dataclass(frozen=True)
class Facts:
    """What a description does not say."""

    locked: dict[str, float] = field(default_factory=dict)  # where other joints stand [rad or m]
    exempt: list[list[str]] | None = None  # links that may touch; None: those that one joint lies between
    floor: float | None = None  # its height [m]
    standing: list[str] = field(default_factory=list)  # links that need not be above the floor
    limits: dict[str, dict[str, Any]] = field(default_factory=dict)  # by kind and joint, before the file's
    packages: list[str] = field(default_factory=list)  # folders of ROS packages
    # to stay on one side of: a unit normal, an offset [m], and the links that are spared
    planes: list[dict[str, Any]] = field(default_factory=list)
    boxes: list[dict[str, Any]] = field(default_factory=list)  # lower and upper corner [m], links spared

    @classmethod
    def read(cls, path: Path | None) -> "Facts":
        """Facts from a file; none without one."""
        return cls(**json.loads(path.read_text("utf-8"))) if path else cls()


class Robot:
    """A description with only those joints moving that trajectories move."""

    def __init__(self, urdf: Path, names: Sequence[str], facts: Facts) -> None:
        self.names, self.facts = list(names), facts
        whole = pin.buildModelFromUrdf(str(urdf))
        folders = [*facts.packages, *(str(folder) for folder in urdf.parents)]
        shapes = pin.buildGeomFromUrdf(whole, str(urdf), pin.GeometryType.COLLISION, None, folders)
        owners = {one.name: whole.frames[one.parentFrame].name for one in shapes.geometryObjects}
        _tell_apart(whole)
        stand = pin.neutral(whole)
        for name, value in facts.locked.items():
            if whole.existJointName(name):
                _place(whole, name, np.array([value]), stand[None])
        others = [k for k in range(1, whole.njoints) if whole.names[k] not in self.names]
        self.model, (self.geometry,) = pin.buildReducedModel(whole, [shapes], others, stand)
        self.data = self.model.createData()
        self.owners = [owners[one.name] for one in self.geometry.geometryObjects]
        self._keep_apart()
        for number, box in enumerate(facts.boxes):
            self._keep_out_of(box, f"box {number}")
        self.moved = [self.model.idx_vs[self.model.getJointId(name)] for name in self.names]

    def _keep_apart(self) -> None:
        spared = {frozenset(pair) for pair in self.facts.exempt or []}
        shapes = self.geometry.geometryObjects
        for i, k in combinations(range(len(shapes)), 2):
            between = abs(shapes[i].parentJoint - shapes[k].parentJoint)
            near = between == 1 and self.facts.exempt is None
            if between and not near and frozenset((self.owners[i], self.owners[k])) not in spared:
                self.geometry.addCollisionPair(pin.CollisionPair(i, k))

    def _keep_out_of(self, box: dict[str, Any], name: str) -> None:
        """Add a box in the world, and pairs of it with every moving link that is not spared."""
        lower, upper = np.array(box["lower"]), np.array(box["upper"])
        place = pin.SE3(np.eye(3), (lower + upper) / 2)
        moving = [
            k
            for k, shape in enumerate(self.geometry.geometryObjects)
            if shape.parentJoint and self.owners[k] not in box.get("spared", [])
        ]
        added = self.geometry.addGeometryObject(
            pin.GeometryObject(name, 0, 0, place, coal.Box(*(upper - lower)))
        )
        self.owners.append(name)
        for k in moving:
            self.geometry.addCollisionPair(pin.CollisionPair(k, added))

    def configurations(self, q: Numbers) -> Numbers:
        """Pinocchio's configurations of positions (T, J)."""
        found = np.tile(pin.neutral(self.model), (len(q), 1))
        for k, name in enumerate(self.names):
            _place(self.model, name, q[:, k], found)
        return found

    def limits(self) -> dict[str, Numbers]:
        """Limits of the joints, (J,) each, (J, 2) of positions; infinite where there are none."""
        model = self.model
        at = [model.idx_qs[model.getJointId(name)] for name in self.names]
        turns = np.array([model.nqs[model.getJointId(name)] > 1 for name in self.names])
        position = np.stack([model.lowerPositionLimit[at], model.upperPositionLimit[at]], 1)
        position[turns] = -np.inf, np.inf
        effort = model.effortLimit[self.moved]
        found = {
            "position": position,
            "velocity": np.array(model.velocityLimit[self.moved]),
            "effort": np.where(effort > 0, effort, np.inf),
            "acceleration": np.full(len(self.names), np.inf),
            "jerk": np.full(len(self.names), np.inf),
        }
        for kind, values in self.facts.limits.items():
            for name, value in values.items():
                if name in self.names:
                    found[kind][self.names.index(name)] = value
        return found

    def efforts(self, configurations: Numbers, dq: Numbers, ddq: Numbers) -> Numbers:
        """Joint torques and forces [N·m or N], (T, J)."""
        found = np.empty_like(dq)
        velocity, acceleration = np.zeros(self.model.nv), np.zeros(self.model.nv)
        for t, q in enumerate(configurations):
            velocity[self.moved], acceleration[self.moved] = dq[t], ddq[t]
            found[t] = pin.rnea(self.model, self.data, q, velocity, acceleration)[self.moved]
        return found

    def colliding(self, configurations: Numbers) -> NDArray[np.bool_]:
        """Whether links collide, (T,)."""
        data = _collision_data(self.geometry)
        manager = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(self.model, self.geometry, data)
        found = (
            pin.computeCollisions(self.model, self.data, manager, q, True)  # up to the first collision
            for q in configurations
        )
        return np.fromiter(found, bool, len(configurations))

    def touching(self, q: Numbers) -> str:
        """Which links collide in a configuration."""
        data = _collision_data(self.geometry)
        pin.computeCollisions(self.model, self.data, self.geometry, data, q, False)
        pairs = zip(self.geometry.collisionPairs, data.collisionResults)
        return "; ".join(
            f"{self.owners[pair.first]} – {self.owners[pair.second]}"
            for pair, result in pairs
            if result.isCollision()
        )

    def height(self, configurations: Numbers) -> float:
        """Smallest height above the floor [m] of any link that is to be above it."""
        if self.facts.floor is None:
            return np.inf
        floor = {"normal": (0.0, 0.0, 1.0), "offset": self.facts.floor, "spared": self.facts.standing}
        return self.distance(configurations, [floor])

    def distance(self, configurations: Numbers, planes: Sequence[dict[str, Any]]) -> float:
        """Smallest distance from planes [m] of any moving link that they do not spare."""
        turns = np.empty((len(configurations), self.model.njoints, 3, 3))
        places = np.empty((len(configurations), self.model.njoints, 3))
        for turn, place, q in zip(turns, places, configurations):
            pin.forwardKinematics(self.model, self.data, q)
            for joint, frame in enumerate(self.data.oMi):
                turn[joint], place[joint] = frame.rotation, frame.translation
        least = np.inf
        for plane in planes:
            normal = np.array(plane["normal"], float)
            for shape, owner in zip(self.geometry.geometryObjects, self.owners):
                if shape.parentJoint and owner not in plane.get("spared", []):
                    along = np.einsum("i,tij->tj", normal, turns[:, shape.parentJoint])
                    away = places[:, shape.parentJoint] @ normal + along @ shape.placement.translation
                    away += _support(shape.geometry, along @ shape.placement.rotation)
                    least = min(least, float(away.min()) - plane["offset"])
        return least


def _tell_apart(model: pin.Model) -> None:
    """Give links other names than joints: Pinocchio cannot reduce models in which a name means both."""
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY:
            frame.name = f"link {frame.name}"


def _collision_data(geometry: pin.GeometryModel) -> pin.GeometryData:
    """Room for collisions with their contacts: without these coal 3.0 misses some of two cylinders."""
    data = geometry.createData()
    for request in data.collisionRequests:
        request.enable_contact = True
    return data


def _place(model: pin.Model, name: str, values: Numbers, configurations: Numbers) -> None:
    """Write positions (T,) of a joint into configurations (T, nq)."""
    joint = model.getJointId(name)
    at = model.idx_qs[joint]
    if model.nqs[joint] == 2:  # without end: cosine and sine
        configurations[:, at], configurations[:, at + 1] = np.cos(values), np.sin(values)
    else:
        configurations[:, at] = values


def _support(shape: coal.CollisionGeometry, z: Numbers) -> Numbers:
    """How far a shape reaches against directions from its origin [m], (T,), in its frame, (T, 3)."""
    match shape:
        case coal.Sphere():
            return np.full(len(z), -shape.radius)
        case coal.Capsule():
            return -np.abs(z[:, 2]) * shape.halfLength - shape.radius
        case coal.Cylinder():
            return -np.abs(z[:, 2]) * shape.halfLength - np.hypot(z[:, 0], z[:, 1]) * shape.radius
        case coal.Box():
            return -np.abs(z) @ shape.halfSide
    points = np.array(shape.points() if isinstance(shape, coal.ConvexBase) else shape.vertices())
    with suppress(QhullError, ValueError):  # else the points lie in a plane, and all of them count
        points = points[ConvexHull(points).vertices]
    return (points @ z.T).min(0)


def check_file(robot: Robot, path: Path) -> dict[str, Any]:
    """Largest shares of limits, collisions and height of a trajectory, and whether all is well."""
    table = pd.read_csv(path)
    time = table["time"].to_numpy()
    q, dq, ddq = (table[[f"{kind}_{name}" for name in robot.names]].to_numpy() for kind in ("q", "dq", "ddq"))
    step = np.diff(time)[:, None]
    configurations, limits = robot.configurations(q), robot.limits()
    middle, half = limits["position"].mean(1), np.ptp(limits["position"], axis=1) / 2
    free = ~np.isfinite(half)
    shares = {
        "position": np.abs(q - np.where(free, 0, middle)) / np.where(free, np.inf, half),
        "velocity": np.abs(dq) / limits["velocity"],
        "effort": np.abs(robot.efforts(configurations, dq, ddq)) / limits["effort"],
        "acceleration": np.abs(ddq) / limits["acceleration"],
        "jerk": np.abs(np.diff(ddq, axis=0) / step) / limits["jerk"],
    }
    worst: dict[str, float] = {name: float(x.max()) for name, x in shares.items()}
    colliding = np.flatnonzero(robot.colliding(configurations))
    found: dict[str, Any] = {
        **worst,
        "consistent": max(_apart(q, dq, step), _apart(dq, ddq, step)),
        "colliding": len(colliding),
        "pair": robot.touching(configurations[colliding[0]]) if len(colliding) else "",
        "height": robot.height(configurations),
        "distance": robot.distance(configurations, robot.facts.planes),
    }
    apart = min(found["height"], found["distance"])
    kept = all(share <= 1 + _ROUNDING for share in worst.values()) and found["consistent"] <= _CONSISTENT
    return {**found, "valid": kept and not len(colliding) and apart >= -_ROUNDING}


def _apart(x: Numbers, rate: Numbers, step: Numbers) -> float:
    """How far differences of a signal are from its rate, as a share of the largest rate."""
    means = (rate[1:] + rate[:-1]) / 2
    return float(np.abs(np.diff(x, axis=0) / step - means).max() / max(np.abs(rate).max(), 1e-9))


def moving(path: Path) -> list[str]:
    """Joints that a trajectory moves."""
    columns = pd.read_csv(path, nrows=0).columns
    return [name.removeprefix("q_") for name in columns if name.startswith("q_")]


def check_folder(urdf: Path, folder: Path, facts: Facts, tell: bool = True) -> dict[str, Any]:
    """Every trajectory in a folder, and the worst of all."""
    files = sorted(path for path in folder.glob("*.csv") if path.stem.isdigit())
    if not files:
        raise SystemExit(f"{folder} has no trajectories")
    robot = Robot(urdf, moving(files[0]), facts)
    rows = []
    for path in files:
        rows.append({"file": path.name, **check_file(robot, path)})
        if tell:
            sys.stderr.write(f"{path.name}: {'valid' if rows[-1]['valid'] else rows[-1]}\n")
    table = pd.DataFrame(rows)
    kinds = ("position", "velocity", "effort", "acceleration", "jerk", "consistent", "colliding")
    return {
        "trajectories": len(rows),
        "valid": int(table.valid.sum()),
        "pairs": len(robot.geometry.collisionPairs),
        **{kind: float(table[kind].max()) for kind in kinds},
        "height": None if facts.floor is None else float(table.height.min()),
        "first": next((row["pair"] for row in rows if row["pair"]), ""),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command: 0 where every trajectory is valid."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.independent", description=__doc__)
    parser.add_argument("urdf", type=Path, help="the description")
    parser.add_argument("folder", type=Path, help="of the CSV files 01.csv, 02.csv …")
    parser.add_argument("--facts", type=Path, help="JSON file: locked, exempt, floor, standing, limits, …")
    options = parser.parse_args(arguments)
    found = check_folder(options.urdf.resolve(), options.folder, Facts.read(options.facts))
    sys.stdout.write(json.dumps(found, indent=1, allow_nan=True) + "\n")
    return 0 if found["valid"] == found["trajectories"] else 1


if __name__ == "__main__":
    sys.exit(main())
