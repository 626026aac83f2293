"""Settings of the seed set and of the single long trajectory."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.conf import chosen
from sidegan.base.storage import file_digest
from sidegan.base.typed import Count, Positive, Seconds, Share, Size, build, changed
from sidegan.errors import ConfigError
from sidegan.seeding.methods import Gradient, Paper
from sidegan.seeding.optimise import Optimiser
from sidegan.seeding.published import REPOSITORY, PublishedSeeds

# Settings that only some methods require, and those that they accept.
_NEEDED = {"gradient": {"reserve"}, "paper": {"ants", "evaluations", "box"}, "published": set[str]()}
_ALLOWED = {"gradient": set[str](), "paper": {"strongest", "shipped"}, "published": {"box"}}
_ROUNDING = 1e-6  # of coefficients in single precision


@dataclass(frozen=True, kw_only=True)
class Seeds:
    """The conventional optimiser that makes the seed set, or the folder of a published one."""

    method: Literal["gradient", "paper", "published"]  # the optimiser
    count: Count  # number of seeds
    samples: Size = 60  # time points per period
    batch: Size = 50  # trajectories per task
    steps: Count  # evaluations; paper: generations of the colony
    attempts: Count = 5  # starts per seed before giving up
    reserve: Share | None = None  # gradient only: share of each limit that seeds keep free
    ants: Size | None = None  # paper only: size of the colony
    evaluations: Count | None = None  # paper only: of the compass search
    # Largest absolute coefficient [rad/s], of seeds and of generators trained on them. Not with gradient;
    # null for published seeds without one.
    box: Positive | None = None
    strongest: Count | None = None  # number of eigenvalues in the eigenvalue fitness; null: all
    folder: str | None = None  # published only: a clone of the authors' repository
    shipped: str | None = None  # paper only: a file next to the settings, with seeds made by them

    def __post_init__(self) -> None:
        if self.method not in list(_NEEDED):
            raise ConfigError(f"method is {self.method!r}, expected one of {', '.join(_NEEDED)}")
        needed, allowed = _NEEDED[self.method], _ALLOWED[self.method]
        others = set.union(*_NEEDED.values(), *_ALLOWED.values()) - needed - allowed
        missing = [name for name in sorted(needed) if getattr(self, name) is None]
        foreign = [name for name in sorted(others) if getattr(self, name) is not None]
        for verb, names in (("needs", missing), ("does not have", foreign)):
            if names:
                raise ConfigError(
                    f"method {self.method} {verb} {', '.join(names)}; seeds={self.method} sets what "
                    f"it needs, in Python sidegan.seeds(…, settings={{'method': {self.method!r}}})"
                )
        if self.method == "published" and self.folder is None:
            raise ConfigError(f"folder is not set: git clone {REPOSITORY}; seeds.folder=SIDE-GAN-Pytorch")

    def stamped(self) -> dict[str, Any]:
        """Plain values that identify artifacts; folders are identified by their contents."""
        if self.method != "published":
            changes_nothing = ("folder", "shipped")
            settings = {name: x for name, x in asdict(self).items() if name not in changes_nothing}
            return {**settings, "fitness": "eigenvalue"}  # of which there was another once
        return {"method": self.method, "count": self.count, "files": file_digest(self.published.file)}

    @property
    def published(self) -> PublishedSeeds:
        """The published seeds."""
        return PublishedSeeds(Path(self.folder or ""))

    @property
    def optimiser(self) -> Optimiser:
        """The configured method."""
        if self.ants is not None and self.evaluations is not None and self.box is not None:
            return Paper(self.steps, self.ants, self.evaluations, self.box, self.attempts)
        return Gradient(self.steps, self.attempts, self.reserve or 0.0)


def seeds_recipe(method: str = "gradient", **changes: Any) -> Seeds:
    """The optimiser that ``seeds=method`` composes, at scale quick, with changed settings.

    Raises:
        ConfigError: when there is no such method, or a setting is unknown or out of range; names it.
    """
    return changed(build(Seeds, chosen("seeds", method, {"seeds": Seeds}) | {"shipped": None}), changes)


def refuse_beyond(c: Array, box: float | None) -> None:
    """Refuse seeds [rad/s] beyond the box of generators trained on them by a ConfigError; None: no box."""
    if box is not None and (most := float(np.abs(c).max())) > (1 + _ROUNDING) * box:
        raise ConfigError(
            f"seeds reach {most:.3g} rad/s, beyond the box of {box:g}: use other seeds, or no box, "
            "seeds.box=null in a command, box=None in Python"
        )


@dataclass(frozen=True, kw_only=True)
class Long:
    """The long trajectory with which short ones are compared, by the gradient method."""

    period: Seconds
    # one with as many parameters as a short trajectory, one with the bandwidth of the short ones
    harmonics: list[Size] = field(default_factory=lambda: [6, 210])
    samples: Size = 2800
    steps: Count  # evaluations of each start
    starts: Count  # of which the best is kept: they differ by a factor of two
