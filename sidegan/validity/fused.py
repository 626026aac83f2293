"""The search for the smallest margins by a compiled kernel: what it is given, and how threads share it."""

import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import torch
from torch import Tensor

from sidegan.motion.compiled import compiled
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.validity.bounds import Slack, link_norms
from sidegan.validity.constraints import Constraints
from sidegan.validity.regions import Plane, Region
from sidegan.validity.search import Search

log = logging.getLogger(__name__)

_NAMES = ("position", "velocity", "torque", "collision", "keep_out")  # the kernel's columns
_ROUNDING = 1e-9  # [m] by which the balls around capsules are larger than they need be
_WORTH_A_THREAD = 2_000  # cells: two milliseconds of work

_models: WeakKeyDictionary[Constraints, Any] = WeakKeyDictionary()


def kernel() -> Any:
    """The module of the compiled kernel; None where numba is missing, unwanted or unfit."""
    if not compiled():
        return None
    try:
        from sidegan.motion.compiled import validity
    except ImportError as error:
        log.info("validity is checked without a compiled kernel: %s", error)
        return None
    return validity


class FusedSearch(Search):
    """The same search with the same outcome, but for rounding, as ``Search``: on processors, much faster."""

    def __init__(self, constraints: Constraints, trajectory: Trajectory, c: Tensor) -> None:
        super().__init__(constraints, trajectory, c)
        if constraints not in _models:
            _models[constraints] = _model(constraints)
        self.model = _models[constraints]._replace(home=np.array(trajectory.home))
        shape = len(c), len(_NAMES)
        self.smallest = kernel().Smallest(np.full(shape, np.inf), np.zeros(shape, np.int64), np.zeros(shape))
        self.columns = {name: _NAMES.index(name) for name in constraints.labels}

    def visit(self, cells: Tensor, count: int, last: bool) -> Tensor:
        """Update the margins from cells (N, 2) of (trajectory, index); those undecided come back."""
        which, index = cells.T.contiguous()
        if count <= len(cells):
            used, rows = torch.arange(count), index
        else:
            used, rows = torch.unique(index, return_inverse=True)
        half = self.trajectory.period / count / 2
        times = (used.to(self.c) + 0.5) * (2 * half)
        basis = torch.stack([self.trajectory.basis(times, order).flatten(1) for order in range(3)], 1)
        motion = [_array(x) for x in (self.c.flatten(2), self.jerk, basis, times)]
        undecided = np.empty(len(cells), dtype=bool)

        def work(part: slice) -> None:
            mine = which.numpy()[part], rows.numpy()[part], half, last, self.smallest, undecided[part]
            kernel().visit(self.model, kernel().work_space(self.model), *motion, *mine)

        _share(work, which)
        self.valid = torch.from_numpy((self.smallest.margin[:, list(self.columns.values())] >= 0).all(1))
        return cells[torch.from_numpy(undecided)]

    def result(self) -> tuple[Tensor, dict[str, Tensor], dict[str, Tensor], dict[str, Tensor]]:
        """Whether each trajectory is valid; the smallest margins, their elements and times."""
        margins, elements, times = (
            {name: torch.from_numpy(table[:, k].copy()) for name, k in self.columns.items()}
            for table in self.smallest
        )
        return self.valid, margins, elements, times


def _share(work: Callable[[slice], None], which: Tensor) -> None:
    """Do work on slices of cells, one per thread of torch's; no trajectory (N,) is in two of them."""
    threads = min(torch.get_num_threads(), len(which) // _WORTH_A_THREAD)
    if threads < 2:
        work(slice(0, len(which)))
        return
    starts = which[[len(which) * k // threads for k in range(1, threads)]].contiguous()
    cuts = [0, *torch.searchsorted(which, starts).tolist(), len(which)]
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, (slice(low, high) for low, high in pairwise(cuts))))


def _array(x: Tensor) -> np.ndarray:
    return np.ascontiguousarray(x.numpy())


def _model(constraints: Constraints) -> Any:
    """The arm in its workspace as the kernel takes it, at home in zero."""
    limit = constraints.arm.torque_limit
    tensors = {
        **_joints(constraints.arm),
        **_shapes(constraints),
        **link_norms(constraints.arm),
        "home": torch.zeros_like(limit),
        "torque": limit if constraints.torque else torch.full_like(limit, torch.inf),
    }
    return kernel().Model(**{name: _array(x) for name, x in tensors.items()})


def _joints(arm: Arm) -> dict[str, Tensor]:
    eye, slides = torch.eye(3, dtype=torch.float64), arm.prismatic[:, None]
    k = torch.linalg.cross(eye[None], arm.axis[:, None], dim=2)  # times x: the axis's cross product with x
    return {
        "prismatic": arm.prismatic,
        "fixed": arm.rotation @ torch.where(slides[..., None], eye, eye + k @ k),
        "sine": torch.where(slides[..., None], 0.0, arm.rotation @ k),
        "cosine": torch.where(slides[..., None], 0.0, -arm.rotation @ k @ k),
        "origin": arm.translation,
        "slide": torch.where(slides, (arm.rotation @ arm.axis[..., None])[..., 0], 0.0),
        "axis": arm.axis,
        "inertia": arm.inertial_parameters,
        "gravity": arm.gravity,
        "lower": arm.position_lower,
        "upper": arm.position_upper,
        "speed": arm.velocity_limit,
    }


def _shapes(constraints: Constraints) -> dict[str, Tensor]:
    capsules, slack = constraints.arm.capsules, Slack(constraints)
    half = (capsules.a - capsules.b).norm(dim=1) / 2
    numbers = [_numbers(region) for region in constraints.regions]
    kinds = [kernel().PLANE if isinstance(region, Plane) else kernel().BOX for region in constraints.regions]
    return {
        "link": capsules.link + 1,
        "a": capsules.a,
        "b": capsules.b,
        "radius": capsules.radius,
        "size": capsules.radius + half + _ROUNDING,
        "pairs": constraints.pairs,
        "pair_reach": slack.pair_reach,
        "pair_most": _most(slack.pair_reach),
        "guarded": constraints.guarded,
        "region_reach": slack.region_reach,
        "region_most": _most(slack.region_reach),
        "kinds": torch.tensor(kinds, dtype=torch.long),
        "regions": torch.tensor(numbers, dtype=torch.float64).reshape(-1, 6),
    }


def _most(reach: Tensor) -> Tensor:
    """Largest reach of each joint, (1, J); zero where nothing is checked."""
    return torch.cat([reach, torch.zeros_like(reach.sum(0))[None]]).amax(0, keepdim=True)


def _numbers(region: Region) -> list[float]:
    if isinstance(region, Plane):
        return [*region.normal, region.offset, 0.0, 0.0]
    sides = list(zip(region.lower, region.upper))
    return [(low + high) / 2 for low, high in sides] + [(high - low) / 2 for low, high in sides]
