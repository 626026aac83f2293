"""Whether shapes are of the order of the arm: meshes in millimetres are a thousand times too large."""

from collections.abc import Mapping

import numpy as np

from sidegan.base.arrays import Array

_LARGE, _LARGE_BASE, _AT_LEAST = 5.0, 50.0, 3.0  # arm's lengths, and [m], from which on shapes are too large
_SMALL = 0.002  # of an arm's length, below which a mesh is too small


def length_of(arm: Mapping[str, Array]) -> float:
    """How far an arm reaches at most from its first joint, about [m], by its numbers as in `Arm`.

    Centres of mass count where nothing else does: one that is far out is a mistake of another kind.
    """
    mass = np.maximum(arm["inertial_parameters"][:, 0], 1e-9)
    centres = np.linalg.norm(arm["inertial_parameters"][:, 1:4], axis=1) / mass
    slides = np.where(arm["prismatic"], arm["position_upper"] - arm["position_lower"], 0.0)
    offsets = np.linalg.norm(arm["translation"][1:], axis=1).sum() + slides.sum()
    return float(offsets + max(np.linalg.norm(arm["tip"]), np.median(centres)))


def of_another_order(size: float, length: float, moves: bool, mesh: bool) -> str:
    """Why a shape of this size [m] is none of an arm's of this length [m]; empty where it may be one.

    What stands still may be a hall, and what has stated sizes a floor or a mark.
    """
    if not (moves or mesh):
        return ""
    if size > max(_AT_LEAST, (_LARGE if moves else _LARGE_BASE) * length):
        return f"{size:.2g} m large: is it in millimetres?"
    if mesh and moves and size < _SMALL * length:
        return f"{size:.2g} m large: are its millimetres made metres twice?"
    return ""
