"""What pictures of motion show: paths of the end effector, and the arm's capsules as meshes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.robot.looks import capsule_surface
from sidegan.validity.capsules import capsule_axes, place_points

_RATE = 25.0  # [Hz] of a drawn trace
_ROOM = 0.02  # [m] around what is drawn, at least


class Mesh(NamedTuple):
    """A surface: vertices [m], (V, 3), and triangles (F, 3)."""

    vertices: np.ndarray
    faces: np.ndarray


class Bundle(NamedTuple):
    """Trajectories whose paths are drawn together."""

    title: str  # for people
    family: Trajectory
    coefficients: Tensor  # [rad/s], (B, J, H, 2)
    colour: str | None = None  # of the paths; None is one that tells the time


class Scene(NamedTuple):
    """Paths of the end effector [m], (B, T, 3), of some bundles, and the box around all, (2, 3)."""

    bundles: list[Bundle]
    paths: list[np.ndarray]
    limits: np.ndarray


class Film(NamedTuple):
    """One trajectory: the end effector's path [m], (T, 3), the arm at some instants [s], (N,), the box."""

    period: float
    path: np.ndarray
    times: np.ndarray
    meshes: list[Mesh]
    limits: np.ndarray


def scene(arm: Arm, bundles: Sequence[Bundle]) -> Scene:
    """The end effector's path along every trajectory of some bundles, above the desk."""
    if not bundles:
        raise ShapeError("there are no sets to draw")
    paths = [tip_traces(arm, bundle.family, bundle.coefficients) for bundle in bundles]
    return Scene(list(bundles), paths, bounds(paths))


def tip_traces(arm: Arm, family: Trajectory, coefficients: Tensor) -> np.ndarray:
    """End effector's positions [m], (B, T, 3), over one period.

    Raises:
        ShapeError: when there is no trajectory, or one does not fit the family or is not finite.
    """
    if len(coefficients) == 0:
        raise ShapeError("there is no trajectory to draw")
    motion = family.roll_out(coefficients.to("cpu", torch.float64), family.times(_RATE))
    batch, count, joints = motion.position.shape
    q = motion.position.reshape(-1, joints).T
    return (
        place_points(arm, q, arm.tip[None], torch.tensor([arm.joints - 1]))[:, 0]
        .T.reshape(batch, count, 3)
        .numpy()
    )


def film(arm: Arm, family: Trajectory, coefficients: Tensor, count: int = 6) -> Film:
    """The arm at ``count`` instants spread over one period, above the desk.

    The ends of the period, where the arm is at home, are left out. Coefficients [rad/s] are (1, J, H, 2).

    Raises:
        ShapeError: when there is not exactly one trajectory, it does not fit the family, or count is none.
    """
    if len(coefficients) != 1:
        raise ShapeError(f"snapshots are of one trajectory, got {len(coefficients)}")
    path = tip_traces(arm, family, coefficients)[0]
    times = family.grid(count)
    positions = family.derivative(coefficients.to("cpu", torch.float64), times, 0)[0]
    meshes = [arm_mesh(arm, q) for q in positions]
    return Film(
        family.period, path, times.numpy(), meshes, bounds([path, *(mesh.vertices for mesh in meshes)])
    )


def arm_mesh(arm: Arm, position: Tensor) -> Mesh:
    """The capsules' surfaces at one joint position [rad or m], (J,)."""
    a, b = (ends[..., 0].T.numpy() for ends in capsule_axes(arm, position[:, None]))
    parts = [capsule_mesh(*capsule) for capsule in zip(a, b, arm.capsules.radius.tolist())]
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = [part.faces + start for part, start in zip(parts, starts)]
    return Mesh(
        np.concatenate([np.zeros((0, 3)), *(part.vertices for part in parts)]),
        np.concatenate([np.zeros((0, 3), int), *faces]),
    )


def capsule_mesh(a: np.ndarray, b: np.ndarray, radius: float) -> Mesh:
    """Surface of all points within ``radius`` [m] of the segment from a to b [m], (3,) each."""
    return Mesh(*capsule_surface(a, b, radius))


def bounds(points: list[np.ndarray]) -> np.ndarray:
    """Corners [m], (2, 3), of a box with all points (…, 3) in it, and with the arm's foot on the desk."""
    flat = np.concatenate([np.zeros((1, 3)), *(x.reshape(-1, 3) for x in points)])
    low, high = flat.min(0), flat.max(0)
    room = np.maximum(0.04 * (high - low).max(), _ROOM)
    low, high = low - room, high + room
    if low[2] > -2 * room:
        low[2] = 0.0  # nothing worth showing is below: the desk is the floor of the picture
    return np.stack([low, high])
