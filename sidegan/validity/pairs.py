"""Pairs of links that are checked for collision, and exemptions; docs/collision.md has the rule."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.base.settings_text import suggest_touching, suggestion
from sidegan.errors import InfeasibleError
from sidegan.robot import Arm
from sidegan.validity.capsules import (
    bodies_of,
    capsule_clearances,
    capsule_distances,
    never_touching,
    piece_distances,
    shapes_alone,
)
from sidegan.validity.thresholds import DISPLACED, MOSTLY_TOUCHING, SHORT_ARM_PAIRS

_TRIED = 200  # configurations in which neighbours' shapes are tested
CONFIGURATIONS = 4_000  # random configurations in which capsules are tested
_INSIDE = 1_000  # of these, in which the pieces inside capsules are tested
_SHOWN, _NEAR = 6, 4  # pairs of links named in messages
_STEPS = 1e4  # per metre; suggested clearances are whole steps
_SPARE = 0.1  # share by which suggested clearances stay below the available distance

Links = tuple[str, str]


@dataclass(frozen=True)
class Pairs:
    """Pairs of capsules to check, and links that are exempt."""

    checked: Array  # (P, 2)
    exempt: tuple[Links, ...]  # neighbours, and pairs named by the user or the description
    # by the latter: who named them, and the share of configurations in which they touch
    named: dict[Links, tuple[str, float]]
    never: tuple[Links, ...]  # that provably cannot touch


@lru_cache(maxsize=16)
def pairs_of(arm: Arm, tight: frozenset[Links] = frozenset()) -> Pairs:
    """The pairs to check of the capsules of an arm that is inflated by the clearance.

    Links that keep a smaller distance (``tight``) may therefore touch.

    Raises:
        InfeasibleError: when links that are not exempt touch in every random configuration; names the
            setting that exempts them.
    """
    touching = _Touching(arm)
    _refuse(arm, touching, tight)
    kept = np.array(sorted(k for links in touching.open for k in touching.rows[links]), int)
    kept = kept[~never_touching(arm, touching.pairs[kept])]
    owners = arm.capsules.owners
    left = {links_of(owners[i], owners[j]) for i, j in touching.pairs[kept].tolist()}
    return Pairs(
        checked=touching.pairs[kept],
        exempt=(*touching.near, *touching.named),
        named={links: (why, touching.share(links)) for links, why in touching.named.items()},
        never=tuple(links for links in touching.open if links not in left),
    )


def random_configurations(arm: Arm, count: int = CONFIGURATIONS) -> Array:
    """Random configurations [rad or m], (count, J); deterministic."""
    random = np.random.default_rng(0)
    return random.uniform(arm.position_lower, arm.position_upper, (CONFIGURATIONS, arm.joints))[:count]


def describe_displaced_shapes(arm: Arm) -> str:
    """A sentence on neighbours whose shapes never come close; empty if there are none."""
    link, owners = arm.capsules.link, arm.capsules.owners
    parents = {links_of(*pair) for pair in arm.parents or ()}
    gaps: dict[Links, float] = {}
    pairs = np.argwhere(np.tri(len(link), k=-1).T)
    least = capsule_distances(arm, random_configurations(arm, _TRIED), pairs).min(0)
    for (i, j), gap in zip(pairs.tolist(), least.tolist()):
        links = links_of(owners[i], owners[j])
        if links in parents and abs(link[i] - link[j]) <= 1 and max(link[i], link[j]) >= 0:
            gaps[links] = min(gaps.get(links, math.inf), gap)
    most = DISPLACED * float(np.linalg.norm(arm.translation[1:], axis=1).sum() + np.linalg.norm(arm.tip))
    far = [f"{' – '.join(links)} ({gap:.2g} m)" for links, gap in gaps.items() if gap > most]
    if not far:
        return ""
    return (
        f"shapes of adjacent links never come close to each other: {listed(far, _SHOWN)}; is the origin of a "
        "shape wrong? Collision checks see the shapes only"
    )


def usual_gaps(arm: Arm) -> dict[Links, float]:
    """Median distances [m] of links that touch in every configuration.

    They are negative, and minus infinity where hulls overlap.
    """
    touching = _Touching(arm)
    return {
        links: float(np.median(touching.nearest(links))) for links in touching.open if touching.always(links)
    }


@lru_cache(maxsize=16)
def usual_room(arm: Arm, need: float) -> dict[Links, float]:
    """Median distances [m] over free configurations, for links with less than they need [m]."""
    touching = _Touching(arm)
    found: dict[Links, float] = {}
    for links in touching.open:
        distance = touching.nearest(links, need)
        free = distance[distance > 0]
        if len(free) and (usual := float(np.median(free))) < need:
            found[links] = usual
    return found


@lru_cache(maxsize=16)
def mostly_touching(arm: Arm) -> dict[Links, float]:
    """Share of configurations in which links touch, for checked links that mostly do."""
    touching = _Touching(arm)
    return {links: share for links in touching.open if (share := touching.share(links)) > MOSTLY_TOUCHING}


def too_large(clearance: float, near: Sequence[str], left: float) -> InfeasibleError:
    """The error for a clearance [m] that some links, by name, never have.

    ``left`` is their largest distance in excess of the clearance [m], negative.
    """
    room = (clearance + left) * (1 - _SPARE) if math.isfinite(left) else 0.0
    most = max(math.floor(room * _STEPS), 0) / _STEPS
    return InfeasibleError(
        f"{suggestion('workspace.clearance', clearance, 'g')} is too large, these are always closer: "
        f"{listed(near, _NEAR)}; try {suggestion('workspace.clearance', most, 'g')}"
    )


def links_of(a: str, b: str) -> Links:
    """Two links in alphabetical order."""
    return (a, b) if a <= b else (b, a)


class _Touching:
    """How often links with joints between them touch in random configurations."""

    def __init__(self, arm: Arm) -> None:
        link, owners = arm.capsules.link, arm.capsules.owners
        pairs = np.argwhere(np.tri(len(link) - arm.capsules.points, k=-1).T)
        apart = np.abs(link[pairs[:, 0]] - link[pairs[:, 1]])
        self.pairs, apart = pairs[apart > 0], apart[apart > 0]  # of capsules on such links, (P, 2)
        self.rows: dict[Links, list[int]] = {}  # indices of these, by pair of links
        for k, (i, j) in enumerate(self.pairs.tolist()):
            self.rows.setdefault(links_of(owners[i], owners[j]), []).append(k)
        parents = None if arm.parents is None else {links_of(*pair) for pair in arm.parents}
        exempt = {links_of(a, b): why for a, b, why in arm.may_touch}
        beside = [links for links, rows in self.rows.items() if apart[rows[0]] == 1]
        self.near = [links for links in beside if parents is None or links in parents]  # neighbours
        rest = [links for links in self.rows if links not in set(self.near)]
        # exempted by the user or the description, and by which; the others are to be checked
        self.named = {links: exempt[links] for links in rest if links in exempt}
        self.open = [links for links in rest if links not in exempt]
        self.q = random_configurations(arm)
        self.bodies = bodies_of(arm, shapes_alone(arm, self.pairs))
        # distances [m] of pairs of capsules, (P, 4000)
        self.capsules = capsule_clearances(self.bodies.chain, self.bodies.shapes, self.q)[0].T

    def nearest(self, links: Links, need: float = math.inf) -> Array:
        """Distances [m] of two links in the first configurations, (1000,), exact below ``need``.

        Negative where they touch, and minus infinity where hulls overlap.
        """
        nearest = np.full(_INSIDE, np.inf)
        for k in self.rows[links]:
            found = self.capsules[k, :_INSIDE].copy()
            if self.bodies.hulls.finer[k]:
                rows = np.flatnonzero(found < np.minimum(nearest, need))
                asked = np.stack([rows, np.full_like(rows, k)], 1)
                found[rows] = np.maximum(found[rows], piece_distances(self.bodies, self.q, asked, need))
            nearest = np.minimum(nearest, found)
        return nearest

    def share(self, links: Links) -> float:
        """Share of the configurations in which two links touch."""
        return float((self.nearest(links, 0.0) <= 0).mean())

    def always(self, links: Links) -> bool:
        """Whether two links touch in every configuration."""
        apart_once = (self.capsules[self.rows[links]] > 0).all(0).any()
        return not apart_once and self.share(links) == 1.0


def _refuse(arm: Arm, touching: _Touching, tight: frozenset[Links]) -> None:
    """Refuse links that always touch, unless they are exempt or tight."""
    stuck = [pair for pair in touching.open if pair not in tight and touching.always(pair)]
    if not stuck:
        return
    if len(stuck) == len(touching.open) > SHORT_ARM_PAIRS:
        raise InfeasibleError(
            f"all {len(stuck)} pairs of non-adjacent links of {arm.name} touch in every one of "
            f"{CONFIGURATIONS:,} random configurations, so none can be checked: are the shapes in metres?"
        )
    names = listed([" and ".join(pair) for pair in stuck], _SHOWN)
    raise InfeasibleError(
        f"links of {arm.name} that touch in every one of {CONFIGURATIONS:,} random configurations: {names}; "
        "correct their shapes or, if contact is expected, leave these pairs unchecked by "
        f"{suggest_touching(stuck, arm.setup.may_touch)}"
    )
