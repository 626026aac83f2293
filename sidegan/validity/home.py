"""Where an arm may rest when nobody says where."""

import torch
from torch import Tensor

from sidegan.errors import InfeasibleError
from sidegan.validity.constraints import Constraints

_SHARES = (0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9)  # of the ranges around their middle, one after the other
_DRAWS = 500  # configurations in each
_ROOM = 0.05  # [m], what counts as far from others: 1 in relative margins


def default_home(constraints: Constraints) -> tuple[float, ...] | None:
    """A position where the arm can rest [rad or m], (J,); None where zeros are one.

    At a limit there is no room to move: such a position is none.

    The one with most room among the first feasible ones around the middle of the ranges; the same on every
    call.

    Raises:
        InfeasibleError: when none was found.
    """
    arm = constraints.arm
    zeros = torch.zeros(1, arm.joints, dtype=torch.float64)
    if bool(_room(constraints, zeros)[0] > 0):
        return None
    middle, half = (
        (arm.position_lower + arm.position_upper) / 2,
        (arm.position_upper - arm.position_lower) / 2,
    )
    random = torch.Generator().manual_seed(0)
    for share in _SHARES:
        draw = 2 * torch.rand(_DRAWS, arm.joints, generator=random, dtype=torch.float64) - 1
        q = middle + share * half * draw
        q = (1e3 * q).round() / 1e3  # figures that people can read and repeat
        room = _room(constraints, q)
        if bool((room > 0).any()):
            return tuple(q[room.argmax()].tolist())
    raise InfeasibleError(
        f"the zero position of {arm.name} is not feasible, and none of {_DRAWS * len(_SHARES):,} others is; "
        "state where it can rest, 'trajectory.home=[…]', or leave out what it cannot keep, workspace=free"
    )


def _room(constraints: Constraints, q: Tensor) -> Tensor:
    """Smallest relative margin of arms at rest, (N,), at positions (N, J)."""
    still = torch.zeros_like(q)
    shares = constraints.relative(constraints.margins(q, still, still, still), _ROOM)
    return torch.cat([*shares.values()], 1).amin(1)
