"""Random serial chains, as sidegan's arm and as Pinocchio's model with the same numbers."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import yaml
from hypothesis import reject

from sidegan.base.arrays import Array
from sidegan.errors import InfeasibleError
from sidegan.robot import Arm, Capsules, Drives
from sidegan.validity import Constraints
from sidegan.validity.pairs import pairs_of
from sidegan.validity.regions import Obstacle
from tests.oracle import chain_model


def random_chain(joints: int, seed: int) -> tuple[Arm, pin.Model]:
    """A chain with arbitrary axes, placements, gravity and inertias, a third of its joints prismatic."""
    random = np.random.default_rng([joints, seed])
    prismatic = random.random(joints) < 1 / 3
    rotation = np.stack([pin.exp3(random.normal(size=3) * 2) for _ in range(joints)])
    translation = random.uniform(-0.4, 0.4, (joints, 3))
    axis = random.normal(size=(joints, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    parameters = np.stack([_inertia(random).toDynamicParameters() for _ in range(joints)])
    gravity = random.normal(size=3) * 6
    names = tuple(f"joint{i + 1}" for i in range(joints))
    arm = Arm(
        name=f"chain{joints}",
        digest=f"{joints}-{seed}",
        joint_names=names,
        link_names=names,
        prismatic=prismatic,
        rotation=rotation,
        translation=translation,
        axis=axis,
        inertial_parameters=parameters,
        position_lower=np.where(prismatic, -0.2, -2.5),
        position_upper=np.where(prismatic, 0.5, 2.0),
        velocity_limit=np.where(prismatic, 0.7, 2.5),
        torque_limit=np.full(joints, 300.0),
        gravity=gravity,
        capsules=_capsules(random, joints),
        urdf=Path("none.urdf"),
        tip=np.zeros(3),
    )
    return lenient(arm), chain_model(arm)


def lenient(arm: Arm) -> Arm:
    """The same arm; links that touch wherever it is are named as such."""
    try:
        pairs_of(arm)
    except InfeasibleError as error:
        for remedy in re.findall(r"may_touch=(\[\[.*?\]\])", str(error)):
            named = tuple((*pair, "a random arm") for pair in yaml.safe_load(remedy))
            return replace(arm, may_touch=(*arm.may_touch, *named))
    return arm


def real_links(joints: int, seed: int) -> Array:
    """Inertial parameters, (joints, 10), of links that are made of masses at points: they can exist."""
    random = np.random.default_rng([joints, seed])
    links = []
    for _ in range(joints):
        points = zip(random.uniform(0.1, 1.0, 6), random.uniform(-0.3, 0.3, (6, 3)))
        links.append(sum(pin.Inertia(m, p, np.zeros((3, 3))).toDynamicParameters() for m, p in points))
    return np.stack(links)


def random_states(arm: Arm, count: int, seed: int = 0) -> tuple[Array, Array, Array]:
    """Positions and velocities within the limits and accelerations within ±5, (count, J) each."""
    generator = np.random.default_rng(seed)
    q, dq, ddq = generator.uniform(-1, 1, (3, count, arm.joints))
    lower, upper = arm.position_lower, arm.position_upper
    return (upper + lower + (upper - lower) * q) / 2, dq * arm.velocity_limit, 5.0 * ddq


def _inertia(random: np.random.Generator) -> pin.Inertia:
    half = random.normal(size=(3, 3)) * 0.2
    mass, centre = random.uniform(0.3, 5.0), random.uniform(-0.3, 0.3, 3)
    return pin.Inertia(mass, centre, half @ half.T + 0.01 * np.eye(3))


def _capsules(random: np.random.Generator, joints: int) -> Capsules:
    """One on every link, and one on the base."""
    ends = random.uniform(-0.2, 0.2, (2, joints + 1, 3))
    radius = random.uniform(0.01, 0.05, joints + 1)
    owners = ("base", *(f"link{i + 1}" for i in range(joints)))
    return exact_capsules(np.arange(-1, joints), *ends, radius, owners)


def exact_capsules(link: Array, a: Array, b: Array, radius: Array, owners: tuple[str, ...]) -> Capsules:
    """Capsules that are the shapes themselves."""
    corners, start = np.stack([a, b], 1).reshape(-1, 3), 2 * np.arange(len(link) + 1)
    exact = np.ones(len(link), bool)
    return Capsules(link, a, b, radius, owners, corners, start, radius, radius, exact, ~exact)


def driven(arm: Arm, seed: int = 0, scale: float = 1.0) -> Arm:
    """An arm whose description states friction and rotors, of some joints none."""
    random = np.random.default_rng(seed)
    columns = scale * random.uniform(-1, [[4.0], [8.0], [0.5]], (3, arm.joints)).clip(0)
    return replace(arm, drives=Drives(*columns))


def constrained(
    arm: Arm, regions: Sequence[Obstacle], torque: bool = True, clearance: float = 0.0
) -> Constraints:
    """A random arm among regions; an arm that never leaves one of them is no example."""
    try:
        whole = Constraints(arm, regions, torque, clearance)
        tight = dict.fromkeys(whole.owners[::2], clearance / 2)  # every other pair keeps half as much
        return Constraints(arm, regions, torque, clearance, tight=tight) if clearance else whole
    except InfeasibleError:
        reject()
