"""Which pairs of links are kept apart, and why others are not: docs/collision.md has the rule."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import torch
from torch import Tensor

from sidegan.base.names import listed
from sidegan.errors import InfeasibleError
from sidegan.robot import Arm
from sidegan.robot.setup import allowed
from sidegan.validity.capsules import capsule_axes, segment_distance
from sidegan.validity.pieces import PieceDistances
from sidegan.validity.proof import never_touching

_FAR = 0.2  # of an arm's length, that shapes of neighbours are nearer to each other
_TRIED = 200  # configurations that these are tried in
SAMPLES = 4_000  # random configurations that capsules are tried in
_INSIDE = 1_000  # of them that what is inside of capsules is tried in
_AT_ONCE = 256  # pairs: bounds the memory to some hundred megabytes
_FEW = 3  # pairs that may all touch always: a short arm has no others
_OFTEN = 0.5  # share of the configurations from which on touching is suspicious
_SHOWN = 6  # pairs of links that a message names

Links = tuple[str, str]


@dataclass(frozen=True)
class Exemption:
    """A pair of links that is not kept apart."""

    links: Links
    why: str  # for people: "neighbours", "never touch", or who named the pair
    share: float | None = None  # of random configurations in which they touch; None: not looked at

    def __str__(self) -> str:
        touching = "" if self.share is None else f", touch in {_percent(self.share)}"
        return f"{' – '.join(self.links)} ({self.why}{touching})"


@dataclass(frozen=True)
class Pairs:
    """Capsules that are kept apart, and links that are not."""

    checked: Tensor  # (P, 2)
    links: int  # pairs of links that are kept apart
    neighbours: tuple[Exemption, ...]  # a link and the nearest one with a shape towards the base
    named: tuple[Exemption, ...]  # that the user or the description names
    never: tuple[Exemption, ...]  # that provably cannot touch
    often: tuple[Exemption, ...]  # that are kept apart, and touch in most configurations


_found: WeakKeyDictionary[Arm, Pairs] = WeakKeyDictionary()


def pairs_of(arm: Arm) -> Pairs:
    """The pairs of an arm's capsules that are kept apart.

    Raises:
        InfeasibleError: when links touch in every random configuration that nobody named, with the setting
            that names them.
    """
    if arm not in _found:
        _found[arm] = _find(arm)
    return _found[arm]


def sampled(arm: Arm, count: int = SAMPLES) -> Tensor:
    """Random configurations [rad or m], (count, J), the same on every call."""
    random = torch.Generator().manual_seed(0)
    draw = torch.rand(arm.joints, SAMPLES, generator=random, dtype=torch.float64)
    return torch.lerp(arm.position_lower[:, None], arm.position_upper[:, None], draw).T[:count]


def capsule_distances(arm: Arm, q: Tensor, pairs: Tensor) -> Tensor:
    """Distances [m], (P, N), of pairs of capsules (P, 2) at positions (N, J)."""
    a, b = capsule_axes(arm, q.T.contiguous())
    radius, found = arm.capsules.radius.to(a), q.new_empty(len(pairs), len(q))
    for part, out in zip(pairs.split(_AT_ONCE), found.split(_AT_ONCE)):
        first, second = part.unbind(1)
        apart = segment_distance(a[:, first], b[:, first], a[:, second], b[:, second])
        out.copy_(apart - (radius[first] + radius[second])[:, None])
    return found


def tell_displaced(arm: Arm) -> str:
    """Which neighbours have shapes that never come near each other; empty where all do."""
    link, owners = arm.capsules.link, arm.capsules.owners
    parents, gaps = {_sorted(*pair) for pair in arm.parents or ()}, dict[Links, float]()
    pairs = torch.combinations(torch.arange(len(link)))
    moved = (link[pairs[:, 0]] - link[pairs[:, 1]]).abs() <= 1
    near = [(i, j) for i, j in pairs[moved].tolist() if _sorted(owners[i], owners[j]) in parents]
    least = capsule_distances(
        arm, sampled(arm, _TRIED), torch.tensor(near, dtype=torch.long).reshape(-1, 2)
    ).amin(1)
    for (i, j), gap in zip(near, least.tolist()):
        if max(link[i], link[j]) >= 0:
            links = _sorted(owners[i], owners[j])
            gaps[links] = min(gaps.get(links, math.inf), gap)
    most = _FAR * float(arm.translation[1:].norm(dim=1).sum() + arm.tip.norm())
    far = [f"{' – '.join(links)} ({gap:.2g} m)" for links, gap in gaps.items() if gap > most]
    if not far:
        return ""
    return (
        f"shapes of neighbouring links never come near each other: {listed(far, _SHOWN)}; is the origin of a "
        "shape wrong? What is said of collisions and distances is true of the shapes alone"
    )


def usual_gaps(arm: Arm) -> dict[Links, float]:
    """Distances [m] that half of the configurations exceed, of links that touch in every one.

    They are below zero, and minus infinity where hulls overlap.
    """
    touching = _Touching(arm)
    return {links: touching.gap(links) for links in touching.open if touching.always(links)}


def _find(arm: Arm) -> Pairs:
    touching = _Touching(arm)
    _refuse(arm, touching)
    kept = torch.tensor([k for links in touching.open for k in touching.rows[links]], dtype=torch.long)
    kept = kept.sort().values
    kept = kept[~never_touching(arm, touching.pairs[kept])]
    owners = arm.capsules.owners
    left = {_sorted(owners[i], owners[j]) for i, j in touching.pairs[kept].tolist()}
    return Pairs(
        checked=touching.pairs[kept],
        links=len(left),
        neighbours=tuple(Exemption(links, "neighbours") for links in touching.near),
        named=tuple(Exemption(links, why, touching.share(links)) for links, why in touching.named.items()),
        never=tuple(Exemption(links, "never touch") for links in touching.open if links not in left),
        often=tuple(touching.often()),
    )


def _sorted(one: str, other: str) -> Links:
    return (one, other) if one <= other else (other, one)


class _Touching:
    """In which share of random configurations links touch that some joint moves against each other.

    Attributes:
        pairs: of capsules on such links, (P, 2).
        rows: of these, by link.
        near: links that are neighbours.
        named: links that somebody named, and who.
        open: links that are to be kept apart.
    """

    def __init__(self, arm: Arm) -> None:
        link, owners = arm.capsules.link, arm.capsules.owners
        pairs = torch.combinations(torch.arange(0 if arm.capsules.points else len(link)))
        apart = (link[pairs[:, 0]] - link[pairs[:, 1]]).abs()
        self.pairs, apart = pairs[apart > 0], apart[apart > 0]
        self.rows: dict[Links, list[int]] = {}
        for k, (i, j) in enumerate(self.pairs.tolist()):
            self.rows.setdefault(_sorted(owners[i], owners[j]), []).append(k)
        parents = None if arm.parents is None else {_sorted(*pair) for pair in arm.parents}
        said = {_sorted(one, other): why for one, other, why in arm.may_touch}
        beside = [links for links, rows in self.rows.items() if apart[rows[0]] == 1]
        self.near = [links for links in beside if parents is None or links in parents]
        rest = [links for links in self.rows if links not in set(self.near)]
        self.named = {links: said[links] for links in rest if links in said}
        self.open = [links for links in rest if links not in said]
        self.q, self.inside = sampled(arm), PieceDistances(arm, self.pairs)
        found = capsule_distances(arm, self.q, self.pairs) if len(self.pairs) else torch.zeros(0, SAMPLES)
        self.apart, self.capsules = found > 0, found[:, :_INSIDE].clone()

    def share(self, links: Links) -> float:
        """Share of the configurations in which two links touch."""
        mine = self.rows[links]
        apart = self.apart[mine].all(0)
        if not self.inside.finer[mine].any():
            return float((~apart).double().mean())
        rows = torch.nonzero(~apart)[:_INSIDE, 0]
        if not len(rows):
            return 0.0
        touch = torch.zeros(len(rows), dtype=torch.bool)
        for k in mine:
            asked = torch.nonzero(~self.apart[k, rows])[:, 0]
            if self.inside.finer[k]:
                question = torch.stack([rows[asked], torch.full_like(asked, k)], 1)
                touch[asked] |= ~(self.inside.lower(self.q, question, 0.0) > 0)
            else:
                touch[asked] = True
        return float(touch.double().mean() * (~apart).double().mean())

    def often(self) -> Iterator[Exemption]:
        """Links that are to be kept apart and touch in most configurations."""
        for pair in self.open:
            if float((~self.apart[self.rows[pair]].all(0)).double().mean()) < _OFTEN:
                continue
            share = self.share(pair)
            if share >= _OFTEN:
                yield Exemption(pair, "kept apart", share)

    def gap(self, links: Links) -> float:
        """Distance of two links that half of the configurations exceed [m]."""
        mine = self.rows[links]
        nearest = torch.full((_INSIDE,), torch.inf, dtype=torch.float64)
        rows = torch.arange(_INSIDE)
        for k in mine:
            found = self.capsules[k]
            if self.inside.finer[k]:
                asked = torch.stack([rows, torch.full_like(rows, k)], 1)
                found = torch.maximum(found, self.inside.lower(self.q, asked))
            nearest = torch.minimum(nearest, found)
        return float(nearest.median())

    def always(self, links: Links) -> bool:
        """Whether two links touch in every configuration."""
        mine = self.rows[links]
        return not bool(self.apart[mine].all(0).any()) and self.share(links) == 1.0


def _refuse(arm: Arm, touching: _Touching) -> None:
    """Refuse links that always touch and that nobody named."""
    stuck = [pair for pair in touching.open if touching.always(pair)]
    if not stuck:
        return
    if len(stuck) == len(touching.open) > _FEW:
        raise InfeasibleError(
            f"all {len(stuck)} pairs of links of {arm.name} that are not adjacent touch in every one of "
            f"{SAMPLES:,} random configurations, so that none can be checked: are the shapes in metres?"
        )
    names = listed([" and ".join(pair) for pair in stuck], _SHOWN)
    raise InfeasibleError(
        f"links of {arm.name} that touch in every one of {SAMPLES:,} random configurations: {names}; correct "
        f"their shapes, or, if nothing is wrong with their touching, {allowed(stuck, arm.setup.may_touch)} "
        "leaves these pairs unchecked"
    )


def tell_often(arm: Arm, often: Sequence[Exemption], apart: float = 0.0) -> str:
    """Message on links that are kept apart, by so much [m], and touch in most configurations."""
    named = allowed([one.links for one in often], arm.setup.may_touch)
    nearer = f" or come nearer than {apart:g} m" if apart else ""
    return (
        f"links that are kept apart and touch{nearer} in most configurations: "
        f"{listed(list(map(str, often)), _SHOWN)}; where one runs inside of the other by design, {named} "
        "leaves these pairs unchecked"
    )


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"
