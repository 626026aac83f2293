"""Arms and tensors as the arrays that kernels take."""

import torch
from torch import Tensor

from sidegan.kernels.chain import Array, Chain, Shapes
from sidegan.robot import Arm, Capsules

_ROUNDING = 1e-9  # [m] by which the balls around capsules are larger than they need be


def chain_of(arm: Arm) -> Chain:
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
    return Chain(*map(array, tensors))


def shapes_of(
    capsules: Capsules,
    pairs: Tensor,
    guarded: Tensor,
    regions: tuple[Tensor, ...],
    closer: Tensor | None = None,
) -> Shapes:
    """Shapes of an arm's capsules and of regions: their numbers (R, 8), kinds (R,) and planes (M, 4).

    Pairs (P, 2) may come so much closer, (P,) [m]; None: not at all.
    """
    ends, radius = torch.stack([capsules.a, capsules.b]), capsules.radius
    size = radius + (ends[0] - ends[1]).norm(dim=1) / 2 + _ROUNDING
    bodies = capsules.link + 1, ends, radius, capsules.core, size
    allowed = ends.new_zeros(len(pairs)) if closer is None else closer
    return Shapes(*map(array, (*bodies, pairs, allowed, guarded, *regions)))


def array(x: Tensor) -> Array:
    """A tensor's numbers, contiguous, without gradient."""
    return x.detach().contiguous().numpy()
