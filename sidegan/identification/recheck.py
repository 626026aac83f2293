"""Whether a model of an arm is still right: what a fresh recording says, and what would explain a change."""

from dataclasses import dataclass
from functools import reduce

import torch
from torch import Tensor

from sidegan.identification.accuracy import inflation_of
from sidegan.identification.fit import weights_of
from sidegan.identification.gather import residual_of
from sidegan.identification.linear import restricted
from sidegan.identification.loaded import LOAD
from sidegan.identification.measurements import Measurements, pieces
from sidegan.identification.model import TorqueModel
from sidegan.identification.score import Score, score, shown
from sidegan.identification.sums import Sums, sums_of

RIGHT, CHANGED, WRONG = "still right", "changed", "no longer right"

_LEAST = 1e-6  # information on each parameter beside the samples'
_MORE = 1.5  # times the largest error at the time of the identification, beyond which something has changed
_FINE = 0.02  # of a joint's torque, an error that is none whatever it was before
_REST = 0.2  # of the error, that a change which explains it may leave
_CLEAR = 4.0  # deviations from which a change is one
_MATTERS = 0.2  # share of the squared error that a change explains at least
_ROUNDS = 3  # of weighting joints by what is left
_FRICTION = ("viscous", "coulomb")
_BEFORE = "error at the identification"


@dataclass(frozen=True, eq=False)
class Change:
    """What may have changed since the identification."""

    what: str  # "friction", "offsets" or "load"
    names: tuple[str, ...]  # of its parameters, (K,)
    values: Tensor  # by how much, (K,)
    deviation: Tensor  # standard deviation of each, also by that of the parameters from before, (K,)
    left: Tensor  # root mean square of what it does not explain [N·m or N], (J,)
    evidence: float  # Bayesian information criterion against no change: the larger the better

    @property
    def clear(self) -> list[tuple[str, float, float]]:
        """Parameters that changed beyond doubt: name, value and deviation."""
        each = zip(self.names, self.values.tolist(), self.deviation.tolist())
        return [(name, x, sigma) for name, x, sigma in each if abs(x) > _CLEAR * sigma]

    @property
    def told(self) -> str:
        """These parameters in words."""
        return ", ".join(f"{name} {x:+.3g} ± {sigma:.1g}" for name, x, sigma in self.clear)


@dataclass(frozen=True, eq=False)
class Recheck:
    """What a fresh recording says about a model."""

    errors: Score  # of the model on the recording, (J,)
    before: Tensor  # largest error in any stretch when it was identified [N·m or N], (J,)
    change: Change | None  # the one that explains the recording best; None when it needs none
    joint_names: tuple[str, ...]

    @property
    def ratio(self) -> Tensor:
        """Error now over the largest one at the identification, (J,)."""
        return self.errors.rmse / self.before

    @property
    def limit(self) -> Tensor:
        """Error up to which nothing has changed [N·m or N], (J,)."""
        size = self.errors.rmse / self.errors.nmse.sqrt().clamp_min(1e-12)
        return torch.maximum(_MORE * self.before, _FINE * size)

    @property
    def verdict(self) -> str:
        """``"still right"``, ``"changed"`` (and by what) or ``"no longer right"``."""
        if not (self.errors.rmse > self.limit).any():
            return RIGHT
        if self.change is None:
            return WRONG
        enough = torch.maximum(self.limit, _REST * self.errors.rmse)
        return WRONG if (self.change.left > enough).any() else CHANGED

    @property
    def statement(self) -> str:
        """The verdict, and what is not as it was although no joint's error says so."""
        if self.change is None or self.verdict != RIGHT:
            return self.verdict
        look = "look" if self.change.what == "offsets" else "looks"
        return f"{RIGHT}, though {self.change.what} {look} different by {self.change.told}"

    @property
    def reasons(self) -> list[str]:
        """Why, a sentence each."""
        worse = [
            f"{name}: {ratio:.1f} times the largest {_BEFORE}"
            for name, ratio, more in zip(
                self.joint_names, self.ratio.tolist(), (self.errors.rmse > self.limit).tolist()
            )
            if more
        ]
        if self.verdict == RIGHT:
            seen = "" if self.change else ", and no change of friction, offsets or load is seen"
            error = f"mean nMSE {shown(self.errors.nmse_mean)}"
            return [f"{error}; no joint has more than {_MORE:g} times its largest {_BEFORE}{seen}"]
        told = [] if self.change is None else [f"{self.change.what} changed: {self.change.told}"]
        if self.verdict == WRONG:
            told.append("neither friction, offsets nor a load at the tip explain it: identify the arm anew")
        return [*worse, *told]


def expected_error(worst: Tensor, then: int, now: int) -> Tensor:
    """Largest error to expect of a model that is still right [N·m or N], (J,).

    A mean over fewer repetitions has more noise. How much of the error at the identification was noise is
    not known: all of it may have been.

    Args:
        worst: largest error in any stretch at the identification [N·m or N], (J,).
        then: over how many repetitions its samples were averaged.
        now: over how many those of the fresh recording are.
    """
    return worst * max(1.0, then / now) ** 0.5


def recheck(
    model: TorqueModel,
    parameters: Tensor,
    covariance: Tensor,
    before: Tensor,
    measurements: list[Measurements],
) -> Recheck:
    """Whether a model with parameters (P,) is still right, by a fresh recording.

    What it leaves unexplained is looked at for a change of friction, of offsets, or of what the last link
    carries; the change of most evidence is told, if it is clear and matters.

    Args:
        model: of the arm.
        parameters: that were identified, (P,).
        covariance: of their errors, (P, P), which pass for changes.
        before: largest root mean square error of each joint in any stretch of the recordings that it was
            identified from and judged by [N·m or N], (J,).
        measurements: the fresh recording.

    Raises:
        ShapeError: when something does not fit the model.
    """
    errors = score(model, parameters, measurements)
    changes = possible_changes(model, parameters, covariance, measurements)
    likely = [one for one in changes if one.evidence > 0 and _worth(one, errors.rmse)]
    best = max(likely, key=lambda one: one.evidence, default=None)
    return Recheck(errors, before, best, model.arm.joint_names)


def possible_changes(
    model: TorqueModel, parameters: Tensor, covariance: Tensor, measurements: list[Measurements]
) -> list[Change]:
    """A change of friction, of offsets, and of the load, each as if it were the only one.

    Arguments and errors are those of ``recheck``.
    """
    names, groups = _columns(model)
    left = [(x, residual_of(model, x, parameters)) for x in pieces(measurements)]
    both = reduce(Sums.plus, (sums_of(_with_known(model, x), r) for x, r in left))
    sums, mixed = _parted(both, len(names))
    all_at_once = restricted(sums, weights_of(sums, _nothing(names)), torch.arange(len(names)), _LEAST)
    each = inflation_of(r - _regressor(model, x) @ all_at_once.parameters for x, r in left)
    return [
        _change(what, sums, places, names, each, (mixed[:, places], covariance))
        for what, places in groups.items()
    ]


def _worth(change: Change, error: Tensor) -> bool:
    """Whether a change is clear, and explains a good part of some joint's error."""
    return bool(change.clear) and float((1 - (change.left / error).square()).max()) > _MATTERS


def _columns(model: TorqueModel) -> tuple[list[str], dict[str, list[int]]]:
    """Names of all changes' parameters, and which of them belong together."""
    joints = model.arm.joint_names
    names: list[str] = []
    groups: dict[str, list[int]] = {"friction": [], "offsets": [], "load": []}
    for kind in (*_FRICTION, "offset"):
        group = groups["offsets" if kind == "offset" else "friction"]
        group += range(len(names), len(names) + len(joints))
        names += [f"{kind} of {joint}" for joint in joints]
    groups["load"] += range(len(names), len(names) + LOAD)
    units = ("mass [kg]", *(f"m·{axis} [kg·m]" for axis in "xyz"), *(f"I{ab}" for ab in _INERTIA))
    return [*names, *units], groups


_INERTIA = ("xx", "xy", "yy", "xz", "yz", "zz")


def _regressor(model: TorqueModel, part: Measurements) -> Tensor:
    """Columns of all changes, (S, J, 3 J + 10)."""
    dq = part.velocity
    sign = torch.tanh(dq / model.terms.sign_width) if part.sign is None else part.sign
    own = [torch.diag_embed(x) for x in (dq, sign, torch.ones_like(dq))]
    return torch.cat([*own, model.body.regressor(*part.states)[..., -LOAD:]], 2)


def _with_known(model: TorqueModel, part: Measurements) -> Tensor:
    """Columns of all changes, and behind them those of the model itself, (S, J, 3 J + 10 + P)."""
    return torch.cat([_regressor(model, part), model.regressor(*part.inputs)], 2)


def _parted(both: Sums, changes: int) -> tuple[Sums, Tensor]:
    """Sums of the columns of changes alone, and their products with the model's, (J, changes, P)."""
    inner = both.information[:, :changes, :changes]
    own = both._replace(information=inner, moment=both.moment[:, :changes])
    return own, both.information[:, :changes, changes:]


def _nothing(names: list[str]) -> Tensor:
    """No change of any parameter."""
    return torch.zeros(len(names), dtype=torch.float64)


def _change(
    what: str,
    sums: Sums,
    places: list[int],
    names: list[str],
    inflation: Tensor,
    known: tuple[Tensor, Tensor],
) -> Change:
    """The change of some parameters that explains most, joints weighted by what it leaves.

    ``known`` holds their columns' products with the model's, (J, K, P), and the covariance of the model's
    parameters, (P, P): an error of those makes the same change appear as it makes torque.
    """
    weights = weights_of(sums, _nothing(names)) / inflation.sqrt()
    nothing = (sums.energy / sums.weight).sqrt()
    for _ in range(_ROUNDS):
        fit = restricted(sums, weights, torch.tensor(places), _LEAST)
        left = (sums.squares(fit.parameters) / sums.weight).sqrt()
        weights = 1 / (left * inflation.sqrt())
    samples = sums.weight / inflation  # that tell as much as independent ones, (J,)
    likelier = 2 * float((samples * (nothing / left).log()).sum())
    evidence = likelier - len(places) * float(samples.sum().log())
    inverse, (mixed, covariance) = fit.inverse[places][:, places], known
    passed = inverse @ torch.einsum("j,jkp->kp", fit.weights.square(), mixed)
    deviation = (inverse + passed @ covariance @ passed.T).diagonal().clamp_min(0).sqrt()
    return Change(what, tuple(names[k] for k in places), fit.parameters[places], deviation, left, evidence)
