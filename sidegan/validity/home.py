"""Default home position and effort of an arm."""

from collections.abc import Sequence

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.settings_text import setting_name, suggestion
from sidegan.errors import ConfigError, InfeasibleError, ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Arm
from sidegan.validity.constraints import Constraints
from sidegan.validity.pairs import random_configurations
from sidegan.validity.remedies import Violation, remedy
from sidegan.validity.thresholds import CAREFUL_EFFORT, CAREFULLY_HELD, HOME_TURN

_SHARES = (0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9)  # of the ranges around their centre, tried in turn
_DRAWS = 500  # configurations for each share
_TRIED = 1000  # configurations in which the arm has to hold itself
_ROOM = 0.05  # [m] distance that is a relative margin of 1


def default_home(constraints: Constraints, spare: float = 0.0) -> tuple[float, ...] | None:
    """A position at which the arm can rest, with room to move [rad or m], (J,); None if zero is one.

    Of random positions around the middle of the ranges, in the smallest neighbourhood with feasible ones, the
    one with most room. Feasible ones leave the share ``spare`` of each kept distance in addition to it.
    Deterministic.

    Raises:
        InfeasibleError: when none was found.
    """
    arm = constraints.arm
    zeros = np.zeros((1, arm.joints))
    if bool(_roomy(constraints, _rooms(constraints, zeros), spare)[0]):
        return None
    middle = (arm.position_lower + arm.position_upper) / 2
    half = (arm.position_upper - arm.position_lower) / 2
    random = np.random.default_rng(0)
    tried = []
    for share in _SHARES:
        draw = 2 * random.random((_DRAWS, arm.joints)) - 1
        q = middle + share * half * draw
        q = (1e3 * q).round() / 1e3  # so that people can type them
        tried.append(_rooms(constraints, q))
        if bool((good := _roomy(constraints, tried[-1], spare)).any()):
            return tuple(q[(_least(tried[-1]) * good).argmax()].tolist())
    # At which positions, (N,). Several parts of a link may share a name.
    violated: dict[Violation, Array] = {}
    for name in tried[0]:
        bad = np.concatenate([rooms[name] <= 0 for rooms in tried])
        for where, part in zip(constraints.labels[name], bad.T):
            violated[name, where] = part | violated.get((name, where), part)
    (name, where), bad = max(violated.items(), key=lambda item: float(item[1].mean()))
    raise InfeasibleError(
        f"no feasible home of {arm.name} found at zero or among {len(bad):,} other "
        f"positions: {bad.mean():.0%} of them violate {name} of {where}; what may help: "
        f"{remedy(constraints, (name, where))}"
    )


def rests_at(constraints: Constraints, home: Sequence[float]) -> bool:
    """Whether an arm can rest at a position (J,) [rad or m] with room to move."""
    rooms = _rooms(constraints, np.array([home], float))
    return bool(_least(rooms)[0] > 0)


def refuse_degrees(arm: Arm, positions: Sequence[float], setting: str, coupling: Array | None = None) -> None:
    """Refuse joint positions, (J,), that make sense only in degrees, by a ConfigError with the radians.

    ``setting`` is its name in the command, and ``coupling`` the matrix, (J, J), of joints' positions from
    those of the setting, if these are others. A wrong number of positions is not checked here.
    """
    if len(positions) != arm.joints:
        return
    coupled = np.eye(arm.joints) if coupling is None else coupling
    q, lower, upper = coupled @ np.array(positions, float), arm.position_lower, arm.position_upper
    turned = np.where(arm.prismatic, q, np.deg2rad(q))
    beyond = ~arm.prismatic & (np.abs(q) > HOME_TURN) & ((q < lower) | (q > upper))
    if bool(beyond.any()) and bool(((turned >= lower) & (turned <= upper)).all()):
        j = int((np.abs(q) * beyond).argmax())
        radians = np.linalg.solve(coupled, turned).tolist()
        raise ConfigError(
            f"{setting_name(setting)} has {float(positions[j]):g} for {arm.joint_names[j]}, whose range is "
            f"{float(lower[j]):.4g} to {float(upper[j]):.4g} rad: are these degrees? In radians they are "
            f"{suggestion(setting, radians, '.4g')}"
        )


def usual_effort(arm: Arm, home: Sequence[float] | None = None) -> float:
    """Default share of an arm's velocity and torque limits: 0.8, or 1 if that would hardly hold the arm.

    It must hold the arm at home (J,) [rad or m], if given, and in nearly all of its range.

    Raises:
        ShapeError: when home is not one position per joint.
        ConfigError: when home is in degrees.
    """
    if home is not None and len(home) != arm.joints:
        raise ShapeError(f"home position {list(home)} must be {arm.joints} finite joint positions")
    refuse_degrees(arm, home or (), "trajectory.home")
    rows = [] if home is None else [list(home)]
    q = np.concatenate([np.array(rows, float).reshape(-1, arm.joints), random_configurations(arm, _TRIED)])
    still = np.zeros_like(q)
    held = np.all(np.abs(RigidBody(arm).torque(q, still, still)) <= CAREFUL_EFFORT * arm.torque_limit, 1)
    there, around = held[: len(rows)], held[len(rows) :]
    return CAREFUL_EFFORT if bool(there.all()) and float(around.mean()) >= CAREFULLY_HELD else 1.0


def _rooms(constraints: Constraints, q: Array) -> dict[str, Array]:
    """Relative margins by constraint, (N, K) each, at rest at positions (N, J)."""
    return constraints.relative(constraints.at_rest(q), _ROOM)


def _roomy(constraints: Constraints, rooms: dict[str, Array], spare: float) -> Array:
    """Whether positions are feasible with the share ``spare`` of each kept distance to spare, (N,)."""
    kept = constraints.kept
    near = [np.all(rooms[name] * _ROOM >= spare * kept[name], 1) for name in kept if name in rooms]
    return np.all([_least(rooms) > 0, *near], 0)


def _least(rooms: dict[str, Array]) -> Array:
    """Smallest relative margin of each position, (N,)."""
    return np.concatenate([*rooms.values()], 1).min(1)
