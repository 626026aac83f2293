"""What a set of trajectories is to tell: all parameters, those of some links, a tool, or torques elsewhere.

A goal is a function of the information Λ that there is already and of that of the motion, G = Σ Yᵀ Y over
the noise's variance, (P, P) each, of parameters that count in units of what is known of them.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import torch
from torch import Tensor

from sidegan.designer.aim import Kind
from sidegan.errors import ConfigError
from sidegan.identification.model import TorqueModel
from sidegan.identification.verdict import joint_of
from sidegan.motion.dynamics import LINK_PARAMETERS

_TOOL, _ARM = 1.0, 0.1  # [kg], [m] of a typical tool
_DOUBT = 10.0  # times these: what a tool may be before anything is measured
_TOLD = 0.5  # of the deviation before, below which something is told of a parameter
_UNITS = ("kg", "kg·m", "kg·m²")


class Form(NamedTuple):
    """A goal as ``sidegan.designer.Aim`` has it."""

    kind: Kind
    interest: dict[str, float] | None = None
    tasks: Tensor | None = None


class Goal(Protocol):
    """What trajectories are to tell."""

    names: tuple[str, ...]  # of what is wanted, (K,)

    @property
    def form(self) -> Form | None:
        """The same for a designer; None where it does not know such a goal."""

    def value(self, known: Tensor, motion: Tensor) -> Tensor:
        """What is to be made small, (…): the mean log of variances, of information (P, P) and (…, P, P)."""

    def deviations(self, known: Tensor, motion: Tensor) -> Tensor:
        """Standard deviation of each of what is wanted, (K,), of information (P, P) each."""

    def said(self, deviations: Tensor, before: Tensor) -> str:
        """What the deviations (K,) are, and were before, in words."""


Wanted = Callable[[TorqueModel, Tensor], Goal]  # of a model whose parameters count in units (P,)


class Everything:
    """Minus the mean log eigenvalue of the information on all parameters: D-optimal design."""

    def __init__(self, model: TorqueModel, unit: Tensor) -> None:
        self.names, self.form, self._unit = tuple(model.names), Form("determinant"), unit

    def value(self, known: Tensor, motion: Tensor) -> Tensor:
        """The mean log variance along the principal axes, (…)."""
        return -_log_det(known + motion) / len(self.names)

    def deviations(self, known: Tensor, motion: Tensor) -> Tensor:
        """Standard deviation of each parameter, (P,)."""
        return torch.linalg.inv(known + motion).diagonal().clamp_min(0).sqrt() * self._unit

    def said(self, deviations: Tensor, before: Tensor) -> str:
        """By how much the deviations fall."""
        return f"with them {_fall(deviations, before)}"


class OfLinks:
    """The same of the parameters that are named after some links and their joints, the others unknown too."""

    def __init__(self, model: TorqueModel, unit: Tensor, links: Sequence[str]) -> None:
        arm = model.arm
        if unknown := [name for name in links if name not in arm.link_names]:
            raise ConfigError(
                f"goal.wanted names {', '.join(unknown)}, expected some of the links that move, "
                f"{', '.join(arm.link_names)}"
            )
        ours = [arm.link_names[joint_of(name)] in links for name in model.names]
        if not any(ours):
            raise ConfigError(
                f"no parameter is named after {', '.join(links) or 'no link'}: expected some of "
                f"{', '.join(arm.link_names)}, or goal.wanted=all"
            )
        self._ours = torch.tensor(ours)
        self.names = tuple(name for name, mine in zip(model.names, ours) if mine)
        self._unit = unit[self._ours]
        self.form = Form("determinant", dict.fromkeys(links, 1.0))
        self._links = ", ".join(links)

    def value(self, known: Tensor, motion: Tensor) -> Tensor:
        """The mean log variance along the principal axes of what is wanted, (…)."""
        whole, others = known + motion, ~self._ours
        rest = whole[..., others, :][..., others]
        return (_log_det(rest) - _log_det(whole)) / len(self.names)

    def deviations(self, known: Tensor, motion: Tensor) -> Tensor:
        """Standard deviation of each of the links' parameters, (K,)."""
        variances = torch.linalg.inv(known + motion).diagonal()[self._ours]
        return variances.clamp_min(0).sqrt() * self._unit

    def said(self, deviations: Tensor, before: Tensor) -> str:
        """By how much the deviations fall."""
        return f"of {self._links} {_fall(deviations, before)}"


class Tool:
    """Minus the mean log eigenvalue of the information on ten parameters of what the last link carries.

    The motion is executed with the tool and, unless the arm was identified before, without it too; in both,
    the arm's parameters are the same unknown ones. As in ``payload``: [Y 0; Y Y_last] [θ; tool] = τ.
    """

    def __init__(self, model: TorqueModel, unit: Tensor, identified: bool) -> None:
        joints, power = model.joints, torch.tensor([0, 1, 1, 1, 2, 2, 2, 2, 2, 2], dtype=torch.float64)
        self.names, self.form = tuple(f"tool {name}" for name in LINK_PARAMETERS), None
        self._typical = _TOOL * _ARM**power
        last = model.mapping[:, 10 * (joints - 1) : 10 * joints]
        self._columns = last * self._typical / unit[:, None]  # the tool's among the parameters', (P, 10)
        self._runs = 1.0 if identified else 2.0

    def _information(self, known: Tensor, motion: Tensor) -> Tensor:
        """Information on the tool in its typical units, with the arm's parameters eliminated, (…, 10, 10)."""
        tool = motion @ self._columns
        factor = torch.linalg.cholesky(known + self._runs * motion)
        half = torch.linalg.solve_triangular(factor, tool, upper=False)
        doubt = torch.eye(len(self.names), dtype=torch.float64) / _DOUBT**2
        return self._columns.T @ tool - half.mT @ half + doubt

    def value(self, known: Tensor, motion: Tensor) -> Tensor:
        """The mean log variance along the principal axes, (…)."""
        return -_log_det(self._information(known, motion)) / len(self.names)

    def deviations(self, known: Tensor, motion: Tensor) -> Tensor:
        """Standard deviation of mass [kg], mass times centre [kg·m] and inertia [kg·m²], (10,)."""
        variances = torch.linalg.inv(self._information(known, motion)).diagonal()
        return variances.clamp_min(0).sqrt() * self._typical

    def said(self, deviations: Tensor, before: Tensor) -> str:
        """Errors of mass, centre of mass times mass, and inertia, as far as the motion tells them."""
        told = deviations < _TOLD * before
        groups = zip(_UNITS, deviations.split([1, 3, 6]), told.split([1, 3, 6]))
        sizes = [f"± {x[some].square().mean().sqrt():.2g} {unit}" for unit, x, some in groups if some.any()]
        untold = [name.removeprefix("tool ") for name, some in zip(self.names, told.tolist()) if not some]
        runs = "" if self._runs == 1 else ", executed with and without it"
        but = f" but for {', '.join(untold)}" if untold else ""
        return f"a tool is told to {', '.join(sizes) or 'nothing'}{but}{runs}"


class Torques:
    """Log of the expected squared error of torques within the limits, over the joints' usual torques."""

    def __init__(self, model: TorqueModel, unit: Tensor, usual: Tensor) -> None:
        self.names = model.arm.joint_names
        each = usual_products(model, usual)
        self.form = Form("variance", tasks=each.mean(0))
        each = each * unit * unit[:, None]
        values, vectors = torch.linalg.eigh(torch.cat([each, each.mean(0, keepdim=True)]))
        roots = vectors * values.clamp_min(0).sqrt()[:, None]
        self._roots, self._root = roots[:-1], roots[-1]  # of each joint's YᵀY, (J, P, P), and of their mean

    def value(self, known: Tensor, motion: Tensor) -> Tensor:
        """The log of the mean over joints, (…)."""
        return self._error(self._root, known + motion).log()

    def deviations(self, known: Tensor, motion: Tensor) -> Tensor:
        """Root mean square error of each joint's torque over its usual one, (J,)."""
        return torch.stack([self._error(root, known + motion) for root in self._roots]).sqrt()

    def _error(self, root: Tensor, information: Tensor) -> Tensor:
        factor = torch.linalg.cholesky(information)
        return torch.linalg.solve_triangular(factor, root, upper=False).square().sum((-2, -1))

    def said(self, deviations: Tensor, before: Tensor) -> str:
        """The error on average."""
        now, then = (float(x.square().mean().sqrt()) for x in (deviations, before))
        return f"torques of other motions are uncertain by {now:.2%} of their usual size, before {then:.2%}"


def usual_products(model: TorqueModel, usual: Tensor) -> Tensor:
    """Each joint's mean YᵀY over its squared usual torque (J,), where the model is to hold, (J, P, P)."""
    rows = model.usual_rows(seed=1) / usual[:, None]
    return torch.einsum("sjp,sjq->jpq", rows, rows) / len(rows)


def _log_det(information: Tensor) -> Tensor:
    """Log determinant of positive definite matrices (…, K, K), (…)."""
    return 2 * torch.linalg.cholesky(information).diagonal(dim1=-2, dim2=-1).log().sum(-1)


def _fall(deviations: Tensor, before: Tensor) -> str:
    share = float((deviations / before).log().mean().exp())
    return f"the parameters' deviations fall to {share:.0%} (geometric mean)"
