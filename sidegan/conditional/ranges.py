"""What may be asked of a conditioned generator: ranges that conditions are drawn from."""

from dataclasses import asdict, dataclass
from typing import Any

from sidegan.errors import ConfigError

Range = tuple[float, float]
Vector = tuple[float, float, float]

KINDS = ("home", "period", "effort", "plane", "walls", "obstacle", "links")


@dataclass(frozen=True)
class Obstacles:
    """Cubes to keep out of: corners of the box that holds their centres, range of their half edge [m]."""

    lower: Vector
    upper: Vector
    half: Range

    def __post_init__(self) -> None:
        _check("obstacle.half", self.half, 0.0)
        if self.half[0] <= 0:
            raise ConfigError(f"obstacle.half is {list(self.half)}, expected positive half edges")
        if any(low > high for low, high in zip(self.lower, self.upper)):
            raise ConfigError(f"obstacle.lower {list(self.lower)} lies above upper {list(self.upper)}")


@dataclass(frozen=True)
class Ranges:
    """Ranges of conditions; what is not asked for is the most generous end.

    Attributes:
        home: how far the home of each joint may lie from the family's [rad or m].
        period: [s]; None: the family's.
        velocity: share of the velocity limits.
        torque: share of the torque limits.
        plane: height that the arm stays above [m]; None: there is no plane to ask for.
        walls: half-widths of the room [m]; None: likewise.
        obstacle: cubes to keep out of; None: likewise.
        links: whether it may be asked which links' parameters matter.
        clearance: distance that a drawn home keeps from walls and obstacles [m].
        active: share of the drawn conditions in which a kind is asked for.

    Raises:
        ConfigError: when a range is empty or out of bounds.
    """

    home: float = 0.0
    period: Range | None = None
    velocity: Range = (1.0, 1.0)
    torque: Range = (1.0, 1.0)
    plane: Range | None = None
    walls: Range | None = None
    obstacle: Obstacles | None = None
    links: bool = False
    clearance: float = 0.1
    active: float = 0.5

    def __post_init__(self) -> None:
        for name, value, least, most in (
            ("period", self.period, 0.0, None),
            ("velocity", self.velocity, 0.0, 1.0),
            ("torque", self.torque, 0.0, 1.0),
            ("plane", self.plane, None, None),
            ("walls", self.walls, 0.0, None),
        ):
            if value is not None:
                _check(name, value, least, most)
        if self.home < 0 or self.clearance < 0:
            raise ConfigError(
                f"home is {self.home} and clearance {self.clearance}, expected nothing negative"
            )
        if not 0 < self.active <= 1:
            raise ConfigError(f"active is {self.active}, expected a share above 0 and up to 1")

    @property
    def kinds(self) -> tuple[str, ...]:
        """What may be asked for at all."""
        wide = {
            "home": self.home > 0,
            "period": self.period is not None,
            "effort": self.velocity[0] < 1 or self.torque[0] < 1,
            "plane": self.plane is not None,
            "walls": self.walls is not None,
            "obstacle": self.obstacle is not None,
            "links": self.links,
        }
        return tuple(kind for kind in KINDS if wide[kind])

    def describe(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)

    @classmethod
    def of(cls, values: dict[str, Any]) -> "Ranges":
        """Ranges of what ``describe`` gave, perhaps through a file."""
        plain: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list) else value for key, value in values.items()
        }
        if plain.get("obstacle") is not None:
            plain["obstacle"] = Obstacles(**{key: tuple(x) for key, x in plain["obstacle"].items()})
        return cls(**plain)


def _check(name: str, value: Range, least: float | None, most: float | None = None) -> None:
    low, high = value
    if not low <= high or (least is not None and low <= least) or (most is not None and high > most):
        bounds = [f"above {least:g}"] if least is not None else []
        bounds += [f"up to {most:g}"] if most is not None else []
        wanted = " ".join(["expected a lower and a higher number", *bounds])
        raise ConfigError(f"{name} is {list(value)}, {wanted}")
