"""Are trajectories what they claim to be? By Pinocchio and coal on a description's own meshes.

Nothing of sidegan takes part. Every sample is checked: position, velocity and effort, acceleration and jerk
where limits are given, self-collision and the floor. What the description does not say are facts.
"""

from dataclasses import dataclass, field
from itertools import combinations

import coal
import numpy as np
import pinocchio as pin

_ROUNDING = 1e-6  # share of a limit by which written numbers may exceed it, and depth in the floor [m]
_GROUND = 20.0  # width and depth of the floor [m]
_CONSISTENT = 1e-3  # largest difference between a rate and its integral's, as a share of the largest rate


@dataclass(frozen=True)
class Facts:
    """What a description does not say."""

    locked: dict = field(default_factory=dict)  # where other joints stand [rad or m]
    exempt: tuple | None = None  # pairs of links that may touch; None: those that one joint lies between
    floor: float = -np.inf  # its height [m]
    standing: list = field(default_factory=list)  # links that need not be above the floor
    limits: dict = field(default_factory=dict)  # by kind and joint, before the file's


class Judge:
    """A description with only those joints moving that trajectories move."""

    def __init__(self, file, names, facts, urdf=None):
        self.names, self.facts = list(names), facts
        urdf = file.read_text() if urdf is None else urdf
        whole = pin.buildModelFromXML(urdf)
        folders = [str(folder) for folder in file.parents]
        shapes = pin.buildGeomFromUrdfString(whole, urdf, pin.GeometryType.COLLISION, None, folders)
        owners = {
            geometry_object.name: whole.frames[geometry_object.parentFrame].name
            for geometry_object in shapes.geometryObjects
        }
        for frame in whole.frames:  # Pinocchio cannot reduce models in which a name means link and joint
            if frame.type == pin.FrameType.BODY:
                frame.name = f"link {frame.name}"
        stand = pin.neutral(whole)
        for name, value in facts.locked.items():
            if whole.existJointName(name):
                _place(whole, name, value, stand[None])
        others = [k for k in range(1, whole.njoints) if whole.names[k] not in self.names]
        self.model, (self.geometry,) = pin.buildReducedModel(whole, [shapes], others, stand)
        self.data = self.model.createData()
        self.owners = [owners[geometry_object.name] for geometry_object in self.geometry.geometryObjects]
        self.moved = [self.model.idx_vs[self.model.getJointId(name)] for name in self.names]
        spared = {frozenset(pair) for pair in facts.exempt or []}
        for (i, first), (k, second) in combinations(enumerate(self.geometry.geometryObjects), 2):
            between = abs(first.parentJoint - second.parentJoint)
            near = between == 1 and facts.exempt is None
            if between and not near and frozenset((self.owners[i], self.owners[k])) not in spared:
                self.geometry.addCollisionPair(pin.CollisionPair(i, k))
        if np.isfinite(facts.floor):
            self._add_floor(facts.floor)

    def _add_floor(self, height):
        """A block of ground that no moving link may touch but those that stand on it."""
        place = pin.SE3(np.eye(3), np.array([0, 0, height - _ROUNDING - _GROUND / 2]))
        block = pin.GeometryObject("floor", 0, place, coal.Box(_GROUND, _GROUND, _GROUND))
        floor = self.geometry.addGeometryObject(block)
        for k, owner in enumerate(self.owners):
            if self.geometry.geometryObjects[k].parentJoint and owner not in self.facts.standing:
                self.geometry.addCollisionPair(pin.CollisionPair(k, floor))

    def configurations(self, q):
        """Pinocchio's configurations of positions (T, J)."""
        found = np.tile(pin.neutral(self.model), (len(q), 1))
        for k, name in enumerate(self.names):
            _place(self.model, name, q[:, k], found)
        return found

    def limits(self):
        """Limits of the joints, (J,) each, (J, 2) of positions; infinite where there are none."""
        model = self.model
        joints = [model.getJointId(name) for name in self.names]
        at = [model.idx_qs[joint] for joint in joints]
        position = np.stack([model.lowerPositionLimit[at], model.upperPositionLimit[at]], 1)
        position[[model.nqs[joint] > 1 for joint in joints]] = -np.inf, np.inf
        effort = model.effortLimit[self.moved]
        found = {
            "position": position,
            "velocity": np.array(model.velocityLimit[self.moved]),
            "effort": np.where(effort > 0, effort, np.inf),
            "acceleration": np.full(len(joints), np.inf),
            "jerk": np.full(len(joints), np.inf),
        }
        for kind, values in self.facts.limits.items():
            for name, value in values.items():
                if name in self.names:
                    found[kind][self.names.index(name)] = value
        return found

    def efforts(self, configurations, dq, ddq):
        """Joint torques and forces [N·m or N], (T, J)."""
        found, velocity, acceleration = np.empty_like(dq), *np.zeros((2, self.model.nv))
        for t, q in enumerate(configurations):
            velocity[self.moved], acceleration[self.moved] = dq[t], ddq[t]
            found[t] = pin.rnea(self.model, self.data, q, velocity, acceleration)[self.moved]
        return found

    def colliding(self, configurations):
        """Whether links collide, with each other or with the floor, (T,)."""
        data = self.geometry.createData()
        for request in data.collisionRequests:
            request.enable_contact = True  # else coal 3.0 misses some contacts of two cylinders
        manager = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(self.model, self.geometry, data)
        found = (pin.computeCollisions(self.model, self.data, manager, q, True) for q in configurations)
        return np.fromiter(found, bool, len(configurations))

    def __call__(self, time, q, dq, ddq):
        """Largest shares of limits and collisions of a trajectory, and whether all is well."""
        step, configurations, limits = np.diff(time)[:, None], self.configurations(q), self.limits()
        middle, half = limits["position"].mean(1), np.ptp(limits["position"], axis=1) / 2
        free = ~np.isfinite(half)
        shares = {
            "position": (q - np.where(free, 0, middle)) / np.where(free, np.inf, half),
            "velocity": dq / limits["velocity"],
            "effort": self.efforts(configurations, dq, ddq) / limits["effort"],
            "acceleration": ddq / limits["acceleration"],
            "jerk": np.diff(ddq, axis=0) / step / limits["jerk"],
        }
        found = {name: float(np.abs(x).max()) for name, x in shares.items()}
        kept = max(found.values()) <= 1 + _ROUNDING
        found["consistent"] = max(_apart(q, dq, step), _apart(dq, ddq, step))
        found["colliding"] = int(self.colliding(configurations).sum())
        well = kept and found["consistent"] <= _CONSISTENT and not found["colliding"]
        return {**found, "valid": well}


def _place(model, name, values, configurations):
    """Write positions (T,) of a joint into configurations (T, nq)."""
    joint = model.getJointId(name)
    at = model.idx_qs[joint]
    if model.nqs[joint] == 2:  # without end: cosine and sine
        configurations[:, at], configurations[:, at + 1] = np.cos(values), np.sin(values)
    else:
        configurations[:, at] = values


def _apart(x, rate, step):
    """How far differences of a signal are from its rate, as a share of the largest rate."""
    means = (rate[1:] + rate[:-1]) / 2
    return float(np.abs(np.diff(x, axis=0) / step - means).max() / max(np.abs(rate).max(), 1e-9))
