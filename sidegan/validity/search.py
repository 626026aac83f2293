"""Search for the smallest margins: coarse cells first, finer ones where a margin is small.

A sample's derivatives and a bound on the next one bound the joints' motion in the cell around it. By triangle
inequalities alone (``sidegan.kernels.formulas``), that bounds the capsules' motion and the torques: upper
bounds on the change of margins between the sample and the edge of its cell.
"""

from functools import lru_cache

import numpy as np

from sidegan.base.arrays import Array, flatten
from sidegan.base.threads import each, threads
from sidegan.kernels import cells as kernel_cells
from sidegan.kernels import proof as kernel
from sidegan.motion.arrays import array
from sidegan.motion.trajectory import Trajectory
from sidegan.robot.consistency import inertia_matrices
from sidegan.validity.capsules import reaches, travel
from sidegan.validity.constraints import CONSTRAINTS, Constraints

COARSE = 0.1  # [s] longest cell of the first pass
SPLIT = 3  # parts of an undecided cell
ORDERS = 5  # derivatives of the motion, including order 0, that kernels take
LEVELS = 7  # passes; cells of the last are 0.1 s / 3⁶ = 0.14 ms long
_WORTH_A_THREAD = 2_000  # cells, two milliseconds of work


def coarse_cells(trajectory: Trajectory) -> int:
    """Number of cells of the first pass over one trajectory."""
    return int(-(-trajectory.period // COARSE))


def jerk_bound(trajectory: Trajectory, c: Array, cells: int) -> Array:
    """Upper bound of the absolute jerk [rad/s³] over the whole period, (B, J)."""
    times = trajectory.grid(cells)
    sampled = np.abs(trajectory.derivative(c, times, 3)).max(1)
    return sampled + derivative_bound(trajectory, c, 4) * (trajectory.period / cells / 2)


def derivative_bound(trajectory: Trajectory, c: Array, order: int) -> Array:
    """Upper bound of the absolute derivative ``order``, 4 or more, over the whole period, (B, J)."""
    return np.einsum("bjhx,hx->bj", np.abs(c), trajectory.derivative_bound(order))


class MarginSearch:
    """The state of a check of coefficients (B, J, H, 2): the smallest margins so far."""

    def __init__(self, constraints: Constraints, trajectory: Trajectory, c: Array) -> None:
        self.trajectory, self.c = trajectory, c
        self.model = model_of(constraints)._replace(home=np.array(trajectory.home))
        self.jerk = jerk_bound(trajectory, c, max(2, int(trajectory.period / COARSE)))
        # Bounds of the fourth and fifth derivative, by which jerk and its derivative change within a cell.
        self.drifts = np.stack([derivative_bound(trajectory, c, order) for order in (4, 5)])
        shape = len(c), len(CONSTRAINTS)
        self.smallest = kernel.Smallest(np.full(shape, np.inf), np.zeros(shape, np.int64), np.zeros(shape))

    def run(self) -> None:
        """Visit cells until every trajectory is decided, or the finest level is done.

        Parts of a cell are checked only for constraints that the cell left undecided.
        """
        count = coarse_cells(self.trajectory)
        cells = np.argwhere(np.ones((len(self.c), count), bool))
        asked = kernel.everything(self.model, len(cells))
        for level in range(LEVELS):
            undecided = self.visit(cells, asked, count, level == LEVELS - 1)
            valid = np.all(self.smallest.margin >= 0, 1)  # so far
            open_ = undecided.any(1) & valid[cells[:, 0]]
            cells, asked = cells[open_], undecided[open_]
            if not len(cells):
                break
            finer = cells[:, 1:] * SPLIT + np.arange(SPLIT)
            cells = np.stack([np.broadcast_to(cells[:, :1], finer.shape), finer], -1).reshape(-1, 2)
            asked = asked.repeat(SPLIT, 0)
            count *= SPLIT

    def visit(self, cells: Array, asked: Array, count: int, last: bool) -> Array:
        """Update the margins from cells (N, 2) of (trajectory, index), with ``count`` cells per period.

        ``asked`` marks the constraints to check, (N, 7) bool; returns those that are undecided, likewise. At
        the ``last`` level, margins of undecided cells are the guaranteed ones, below zero.
        """
        which, index = np.ascontiguousarray(cells.T)  # another layout would compile the kernel again
        if count <= len(cells):
            used = np.arange(count)
            rows = index
        else:
            used, rows = np.unique(index, return_inverse=True)
        half = self.trajectory.period / count / 2
        centres = (used + 0.5) * (2 * half)
        functions = [flatten(self.trajectory.basis(centres, order), 1) for order in range(ORDERS)]
        arrays = flatten(self.c, 2), self.jerk, self.drifts, np.stack(functions, 1), centres
        c, jerk, drifts, basis, times = map(array, arrays)
        motions = kernel_cells.Motions(c, jerk, drifts, basis, times, half)
        undecided = np.empty(asked.shape, bool)
        cuts = _cuts(which)

        def work(k: int) -> None:
            part = slice(cuts[k], cuts[k + 1])
            chunk = kernel.Cells(which[part], rows[part], last, asked[part], undecided[part])
            kernel.visit(self.model, kernel_cells.work_space(self.model), motions, chunk, self.smallest)

        each(work, len(cuts) - 1)
        return undecided


def _cuts(which: Array) -> list[int]:
    """Bounds of each thread's share of cells, whose trajectories are (N,); none is in two shares."""
    count = max(1, min(threads(), len(which) // _WORTH_A_THREAD))
    starts = which[[len(which) * k // count for k in range(1, count)]]
    return [0, *np.searchsorted(which, starts).tolist(), len(which)]


@lru_cache(maxsize=16)
def model_of(constraints: Constraints) -> kernel_cells.Model:
    """The arm in its workspace for the kernel, with home at zero."""
    arm = constraints.arm
    pairs, pieces, regions = reaches(arm, constraints.pairs, constraints.guarded)
    drives, parameters = arm.known_drives, arm.inertial_parameters
    limit = arm.torque_limit - drives.coulomb
    arrays = {
        "parameters": parameters.ravel(),
        "home": np.zeros_like(limit),
        "lower": arm.position_lower,
        "upper": arm.position_upper,
        "speed": arm.velocity_limit,
        "torque": limit if constraints.torque else np.full_like(limit, np.inf),
        "viscous": drives.viscous,
        "rotor": drives.rotor_inertia,
        "higher": constraints.higher_rows,
        "pair_reach": pairs,
        "piece_reach": pieces,
        "region_reach": regions,
        "reach_most": np.concatenate([pairs, regions, np.zeros((1, arm.joints))]).max(0, keepdims=True),
        # for bounds of torques: distance to the next frame, mass, norms of first and second moments of mass
        "travel": travel(arm),
        "mass": np.abs(parameters[:, 0]),
        "first": np.linalg.norm(parameters[:, 1:4], axis=1),
        "spin": np.linalg.matrix_norm(inertia_matrices(parameters), ord=2),
    }
    return kernel_cells.Model(constraints.bodies, **{name: array(x) for name, x in arrays.items()})
