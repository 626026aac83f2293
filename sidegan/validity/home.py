"""Where an arm may rest, and how hard it may work, when nobody says so."""

from collections.abc import Sequence

import torch
from torch import Tensor

from sidegan.errors import InfeasibleError, ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Arm
from sidegan.validity.constraints import Constraints
from sidegan.validity.pairs import sampled

_SHARES = (0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9)  # of the ranges around their middle, one after the other
_DRAWS = 500  # configurations in each
_CAREFUL = 0.8  # of the limits: a controller whose feedforward is wrong by a fourth stays within them
_HELD, _TRIED = 0.95, 1000  # share of the configurations in which the arm holds itself then, and how many
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


def usual_effort(arm: Arm, home: Sequence[float] | None = None) -> float:
    """Share of an arm's velocity and torque limits for its first run; all where less hardly holds it.

    It must hold the arm at home (J,) [rad or m], where that is known, and in nearly all of its range.

    Raises:
        ShapeError: when home is not one position per joint.
    """
    if home is not None and len(home) != arm.joints:
        raise ShapeError(f"home position {list(home)} must be {arm.joints} finite joint positions")
    rows = [] if home is None else [list(home)]
    q = torch.cat([torch.tensor(rows, dtype=torch.float64).reshape(-1, arm.joints), sampled(arm, _TRIED)])
    still = torch.zeros_like(q)
    held = (RigidBody(arm).torque(q, still, still).abs() <= _CAREFUL * arm.torque_limit).all(1)
    there, around = held[: len(rows)], held[len(rows) :]
    return _CAREFUL if bool(there.all()) and float(around.double().mean()) >= _HELD else 1.0


def _room(constraints: Constraints, q: Tensor) -> Tensor:
    """Smallest relative margin of arms at rest, (N,), at positions (N, J)."""
    still = torch.zeros_like(q)
    shares = constraints.relative(constraints.margins(q, still, still, still), _ROOM)
    return torch.cat([*shares.values()], 1).amin(1)
