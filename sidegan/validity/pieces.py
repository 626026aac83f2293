"""How far apart the convex pieces inside of capsules are: compiled where numba is there, else by NumPy."""

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from sidegan.motion.backend import usable
from sidegan.motion.compiled.chain import Chain, Shapes, array
from sidegan.robot import Arm
from sidegan.robot.arm import Pieces
from sidegan.validity.capsules import frames_of, segment_distance
from sidegan.validity.hulls import Hull, apart, nearest_points
from sidegan.validity.regions import tables

if TYPE_CHECKING:
    from sidegan.motion.compiled.hulls import Hulls

Floats = NDArray[np.float64]


class PieceDistances:
    """Distances of the pieces of pairs of capsules.

    Args:
        arm: whose pieces they are.
        pairs: of capsules, (P, 2).

    Attributes:
        finer: whether the pieces of a pair may be farther apart than its capsules, (P,) bool.
    """

    def __init__(self, arm: Arm, pairs: Tensor) -> None:
        self.arm, self.pairs = arm, pairs
        self.pieces = arm.capsules.pieces
        self.finer = torch.zeros(len(pairs), dtype=torch.bool)
        if self.pieces is not None:
            self.finer = ~self.pieces.exact[pairs].all(1)

    def lower(self, q: Tensor, asked: Tensor, need: float = float("inf")) -> Tensor:
        """Lower bounds of distances [m], (M,), exact but for 1e-8 m; minus infinity where pieces touch.

        Args:
            q: positions [rad or m], (N, J).
            asked: row and pair of each question, (M, 2).
            need: a bound that is enough, as precise as it may be.
        """
        if self.pieces is None or not len(asked):
            return q.new_full((len(asked),), -torch.inf)
        if usable(q):
            return self._compiled(q, asked, need)
        return self._plain(self.pieces, q, asked)

    def shapes(self) -> Shapes:
        """The capsules and their pairs, without regions, as compiled kernels take them."""
        return Shapes.of(self.arm.capsules, self.pairs, torch.zeros(0, 2, dtype=torch.long), tables(()))

    def hulls(self) -> "Hulls":
        """The pieces as compiled kernels take them."""
        from sidegan.motion.compiled.hulls import Hulls

        if self.pieces is None:
            return Hulls.none(len(self.arm.capsules.radius), len(self.pairs))
        tensors = self.pieces.corners, self.pieces.start, self.pieces.radius, self.around, self.finer
        return Hulls(*map(array, tensors))

    @cached_property
    def around(self) -> Tensor:
        """How far the corners of each piece are from its capsule's axis at most [m], (C,)."""
        capsules, pieces = self.arm.capsules, self.pieces
        if pieces is None:
            return torch.zeros_like(capsules.radius)
        counts = pieces.start.diff()
        a, b = (x.repeat_interleave(counts, 0).T for x in (capsules.a, capsules.b))
        apart = segment_distance(a, b, pieces.corners.T, pieces.corners.T)
        return torch.stack([part.max() for part in apart.split(counts.tolist())])

    def _compiled(self, q: Tensor, asked: Tensor, need: float) -> Tensor:
        from sidegan.motion.compiled import hulls as kernel

        order = torch.argsort(asked[:, 0], stable=True)
        shapes = self.shapes()
        out = np.empty(len(asked))
        room = kernel.place_for(shapes, self.arm.joints)
        bodies = kernel.Bodies(Chain.of(self.arm), shapes, self.hulls())
        kernel.distances(bodies, array(q), array(asked[order]), need, out, room)
        found = torch.empty(len(asked), dtype=torch.float64)
        found[order] = torch.from_numpy(out)
        return found

    def nearest(self, q: Tensor, asked: Tensor) -> Tensor:
        """Nearest points of the hulls [m], (M, 2, 3), in the world; not numbers where these touch.

        Args:
            q: positions [rad or m], (N, J).
            asked: row and pair of each question, (M, 2).
        """
        out = np.full((len(asked), 2, 3), np.nan)
        if self.pieces is not None:
            for _, mine, hulls in self._placed(self.pieces, q, asked):
                out[mine] = nearest_points(*hulls)
        return torch.from_numpy(out).to(q)

    def _plain(self, pieces: Pieces, q: Tensor, asked: Tensor) -> Tensor:
        out = np.empty(len(asked))
        for p, mine, hulls in self._placed(pieces, q, asked):
            out[mine] = apart(*hulls) - float(pieces.radius[self.pairs[p]].sum())
        return torch.from_numpy(out).to(q)

    def _placed(
        self, pieces: Pieces, q: Tensor, asked: Tensor
    ) -> Iterator[tuple[int, NDArray[np.int64], tuple[Hull, Hull]]]:
        """Each pair that is asked about, which questions these are, and both hulls where they are then."""
        turns, places = (x.double().numpy() for x in frames_of(self.arm, q.T.contiguous()))
        corners, start = pieces.corners.numpy(), pieces.start.tolist()
        rows, which = asked.T.numpy()

        def hull(c: int, at: NDArray[np.int64]) -> Hull:
            frame = int(self.arm.capsules.link[c]) + 1
            return corners[start[c] : start[c + 1]], turns[frame, at], places[frame, at]

        for p in np.unique(which).tolist():
            mine = np.flatnonzero(which == p)
            one, other = self.pairs[p].tolist()
            yield p, mine, (hull(one, rows[mine]), hull(other, rows[mine]))
