"""An arm's kinematics as the plain arrays that kernels take."""

from typing import NamedTuple

import numpy as np
import torch

from sidegan.robot import Arm


class Chain(NamedTuple):
    """Placements of J joints; a joint's rotation in its parent is fixed + sine · sin(q) + cosine · cos(q).

    Attributes:
        prismatic: whether a joint slides, (J,) bool.
        fixed: (J, 9), row by row.
        sine: (J, 9).
        cosine: (J, 9).
        origin: of the joint's frame in its parent's at q = 0 [m], (J, 3).
        slide: how that origin moves with q, (J, 3); zero where the joint turns.
        axis: in the joint's own frame, (J, 3).
        gravity: [m/s²], (3,).
    """

    prismatic: np.ndarray
    fixed: np.ndarray
    sine: np.ndarray
    cosine: np.ndarray
    origin: np.ndarray
    slide: np.ndarray
    axis: np.ndarray
    gravity: np.ndarray

    @classmethod
    def of(cls, arm: Arm) -> "Chain":
        """The chain of an arm."""
        eye, slides = torch.eye(3, dtype=torch.float64), arm.prismatic[:, None, None]
        spin = torch.linalg.cross(arm.axis[:, :, None], eye[None], dim=1)  # of a unit turn, (J, 3, 3)
        tensors = [
            arm.prismatic,
            (arm.rotation @ torch.where(slides, eye, eye + spin @ spin)).flatten(1),
            torch.where(slides, 0.0, arm.rotation @ spin).flatten(1),
            torch.where(slides, 0.0, -arm.rotation @ spin @ spin).flatten(1),
            arm.translation,
            torch.where(slides, arm.rotation @ arm.axis[..., None], 0.0)[..., 0],
            arm.axis,
            arm.gravity,
        ]
        return cls(*(np.ascontiguousarray(x.numpy()) for x in tensors))
