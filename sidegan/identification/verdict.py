"""A verdict on an identified model, in words."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from torch import Tensor

from sidegan.identification.estimate import Estimate
from sidegan.identification.score import Folds, Score
from sidegan.robot import Arm

GOOD, USABLE, BAD = "good", "usable", "not trustworthy"
_NAMED = 6  # parameters that a reason names at most
_LITTLE = 0.25  # of a limit
_MOST = 10.0  # a larger share says no more


@dataclass(frozen=True)
class Thresholds:
    """What counts as good and as usable; nMSE are of validation, or of training without it.

    Attributes:
        good_nmse: mean over joints up to which a model is good.
        usable_nmse: and up to which it is usable.
        good_joint_nmse: of the worst joint of a good model.
        usable_joint_nmse: of the worst joint of a usable one.
        overfit: largest ratio of validation to training nMSE, means over joints, of a good model.
        condition: largest condition number of a good model's scaled regressor.
        effect: a parameter is weak when one deviation of it makes more than this share of a joint's torque.
        good_torque: largest deviation of predicted torque, as a share of it, of a good model.
        usable_torque: and of a usable one.
    """

    good_nmse: float = 0.02
    usable_nmse: float = 0.1
    good_joint_nmse: float = 0.05
    usable_joint_nmse: float = 0.3
    overfit: float = 3.0
    condition: float = 100.0
    effect: float = 0.1
    good_torque: float = 0.1
    usable_torque: float = 0.5


class Finding(NamedTuple):
    """Something that keeps a model from being good.

    Attributes:
        level: the best verdict that it leaves.
        text: the reason.
    """

    level: str
    text: str


@dataclass(frozen=True, eq=False)
class Evidence:
    """What a verdict rests on.

    Attributes:
        arm: the arm that was identified.
        estimate: its parameters.
        train: errors on what was identified from.
        validation: errors on what was held out; None when nothing was.
        nominal_score: errors of the description's link parameters with fitted friction, on the same samples
            as ``validation``, or else ``train``.
        folds: each recording predicted from the others; None when not asked for.
        weak: parameters whose errors matter, the worst first.
        torque_deviation: standard deviation of the predicted torque over the joint's usual torque, anywhere
            within the limits, (J,).
    """

    arm: Arm
    estimate: Estimate
    train: Score
    validation: Score | None
    nominal_score: Score
    folds: Folds | None
    weak: tuple[str, ...]
    torque_deviation: Tensor

    @property
    def judged(self) -> Score:
        """Errors on what was held out, or else on what was trained with."""
        return self.held_out or self.train

    @property
    def held_out(self) -> Score | None:
        """Errors on the validation, or else on each recording by the others; None without."""
        if self.validation is not None or self.folds is None:
            return self.validation
        folds = self.folds
        return Score(folds.nmse.mean(0), folds.rmse.square().mean(0).sqrt(), self.train.samples)

    @property
    def where(self) -> str:
        """What these errors are of."""
        if self.validation is not None:
            return "validation data"
        return "training data" if self.folds is None else "each recording by the others"

    def joint(self, j: int) -> str:
        """What to call joint j."""
        return f"joint {j + 1} ({self.arm.joint_names[j]})"


def judge(evidence: Evidence, thresholds: Thresholds) -> tuple[str, list[str]]:
    """Verdict and its reasons, the gravest first."""
    findings = [
        *_held_out(evidence, thresholds),
        *_misfits(evidence, thresholds),
        *_excitation(evidence, thresholds),
    ]
    if not findings:
        error = f"mean nMSE {evidence.judged.nmse_mean:.4f} on {evidence.where}"
        return GOOD, [f"{error}, and every parameter that matters is certain"]
    grave = [f.text for f in findings if f.level == BAD]
    return BAD if grave else USABLE, grave + [f.text for f in findings if f.level == USABLE]


def _held_out(evidence: Evidence, thresholds: Thresholds) -> Iterator[Finding]:
    train, validation, folds = evidence.train, evidence.held_out, evidence.folds
    if validation is None:
        yield Finding(USABLE, "no recording was held out: how well the model predicts others is not known")
    elif validation.nmse_mean > max(thresholds.overfit * train.nmse_mean, thresholds.good_nmse / 2):
        ratio = validation.nmse_mean / train.nmse_mean
        yield Finding(
            USABLE,
            f"validation nMSE is {ratio:.1f} times that of training: give more, or more varied, recordings",
        )
    if evidence.judged.nmse_mean >= evidence.nominal_score.nmse_mean:
        error = evidence.nominal_score.nmse_mean
        yield Finding(
            USABLE, f"the description's own link parameters predict as well (mean nMSE {error:.4f})"
        )
    if folds is not None and float(folds.nmse.mean()) > thresholds.good_nmse:
        worst = int(folds.nmse.mean(1).argmax())
        error = float(folds.nmse[worst].mean())
        yield Finding(USABLE, f"recording {worst + 1} is predicted by the others with mean nMSE {error:.3f}")


def _misfits(evidence: Evidence, thresholds: Thresholds) -> Iterator[Finding]:
    judged, where = evidence.judged, evidence.where
    if judged.nmse_mean > thresholds.good_nmse:
        level = BAD if judged.nmse_mean > thresholds.usable_nmse else USABLE
        yield Finding(level, f"mean nMSE is {judged.nmse_mean:.3g} on {where}")
    for j, error in enumerate(judged.nmse.tolist()):
        if error > thresholds.good_joint_nmse:
            level = BAD if error > thresholds.usable_joint_nmse else USABLE
            left = f"the model leaves {error:.0%} of the torque's variance unexplained"
            text = left if math.isfinite(error) else "the torque is constant"
            yield Finding(level, f"{evidence.joint(j)}: {text} on {where}")


def _excitation(evidence: Evidence, thresholds: Thresholds) -> Iterator[Finding]:
    condition = evidence.estimate.condition
    if math.isinf(condition):
        yield Finding(USABLE, "the arm is poorly excited: some parameters have no effect in this motion")
    elif condition > thresholds.condition:
        alike = f"condition number {condition:.0f} of the scaled regressor"
        yield Finding(USABLE, f"the arm is poorly excited: parameters act alike in this motion ({alike})")
    for j, share in enumerate(evidence.torque_deviation.tolist()):
        own = _list([name for name in evidence.weak if _joint_of(name) == j])
        if share > thresholds.good_torque:
            level = BAD if share > thresholds.usable_torque else USABLE
            size = f"{share:.0%}" if share < _MOST else f"more than {_MOST:.0%}"
            text = f"is not identifiable from this data: torque in other motions is uncertain by {size}"
            names = f" ({own})" if own else ""
            yield Finding(level, f"{evidence.joint(j)} {text}{names}; {_advice(evidence, j)}")
        elif own:
            yield Finding(USABLE, f"{evidence.joint(j)}: {own} cannot be told; {_advice(evidence, j)}")


def _advice(evidence: Evidence, j: int) -> str:
    """How to excite a joint better than it was."""
    arm, reach = evidence.arm, evidence.estimate.reach
    limit, fastest = float(arm.velocity_limit[j]), float(reach.fastest[j])
    span, unit = float(arm.position_upper[j] - arm.position_lower[j]), "m" if arm.prismatic[j] else "rad"
    moved = float(reach.range[j])
    wishes = []
    if moved < _LITTLE * span:
        wishes.append(f"goes further than {moved:.2g} of {span:.3g} {unit}")
    if fastest < _LITTLE * limit:
        wishes.append(f"is faster than {fastest:.2g} of {limit:.3g} {unit}/s")
    if not wishes:
        wishes.append("has several frequencies at once and is not in step with other joints")
    return f"excite it with a motion that {' and '.join(wishes)}"


def _joint_of(name: str) -> int:
    """Joint or link, from 0, that a parameter's name ends with."""
    found = re.search(r"\d+$", name)
    return int(found.group()) - 1 if found else -1


def _list(names: list[str]) -> str:
    rest = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + rest
