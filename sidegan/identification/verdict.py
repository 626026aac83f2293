"""A verdict on an identified model, in words."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from statistics import NormalDist
from string import ascii_letters
from typing import NamedTuple

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.identification import thresholds
from sidegan.identification.estimate import Estimate, Score, nmse_text
from sidegan.robot import Arm


class Finding(NamedTuple):
    """Something that keeps a model from being good, or is worth reporting."""

    level: str  # the best verdict that it allows
    text: str
    joint: int | None = None  # joint concerned; None: the whole arm
    leads: bool = False  # whether it is said first, however little it limits


GOOD, USABLE, BAD = "good", "usable", "not trustworthy"

_NAMED = 6  # parameters that a reason names at most
_MOST = 10.0  # shares above are reported as "more than"
_FRICTION = ("fv", "fc", "Ia")  # prefixes of the parameters that cannot be negative
_SHAPED = ("sa", "fr")  # of effects beside which they are only parts of a curve, and can


@dataclass(frozen=True, eq=False, kw_only=True)
class Quality:
    """Quality of an identified model, and the verdict that follows from it."""

    arm: Arm
    estimate: Estimate
    train: Score  # training errors
    held_out: Score | None  # errors on the validation, or else on each recording by the others
    where: str  # data that the errors which count are on
    folds: Score | None  # of each recording predicted from the others; None if not computed
    nominal_score: Score  # of the description's links with fitted friction, on the same samples
    torque_deviation: Array  # standard deviation of predicted torques, relative to the usual torque, (J,)
    usual: Array  # usual torque: root mean square within the limits [N·m or N], (J,)
    weak: tuple[str, ...]  # parameters whose errors matter, worst first
    noise: Array  # whether a joint's residual is noise, (J,)
    causes: tuple[Finding, ...] = ()  # faults of recordings or description that may cause other findings
    other_gravity: bool = False  # whether a different gravity explains the torques better
    copied: str | None = None  # warning that the data tested on are of a run for training

    @property
    def verdict(self) -> str:
        """``"good"``, ``"usable"`` or ``"not trustworthy"``."""
        levels = [finding.level for finding in self.findings]
        return next((level for level in (BAD, USABLE) if level in levels), GOOD)

    @property
    def reasons(self) -> list[str]:
        """Reasons for the verdict: causes, then findings grouped by joint, most severe first.

        What is taken into account already, and limits nothing, comes last unless the model is good.
        """
        groups: dict[object, list[Finding]] = {}
        sentences = []
        for finding in self.findings[len(self.causes) :]:
            groups.setdefault(finding.text if finding.joint is None else finding.joint, []).append(finding)
        worst_first = sorted(groups.values(), key=lambda group: all(x.level != BAD for x in group))
        minor = [[cause] for cause in self.causes if cause.level == GOOD and not cause.leads]
        causes = [[cause] for cause in self.causes if cause.level != GOOD or cause.leads]
        first, last = ([*causes, *minor], []) if self.verdict == GOOD else (causes, minor)
        for group in [*first, *worst_first, *last]:
            texts = "; ".join(finding.text for finding in group)
            joint = group[0].joint
            sentences.append(texts if joint is None else f"{self.joint(joint)}: {texts}")
        if self.verdict == GOOD:
            error = f"mean nMSE {nmse_text(self.judged.nmse_mean)} on {self.where}"
            sentences.append(f"{error}, and every parameter that matters is certain")
        return sentences

    @cached_property
    def findings(self) -> list[Finding]:
        """All findings, causes first."""
        return [*self.causes, *_held_out(self), *_misfits(self), *_excitation(self), *_negative(self)]

    def as_good(self, errors: Score) -> bool:
        """Whether something with these errors predicts within a tenth as well as the model."""
        return self.mean(errors) <= thresholds.AS_GOOD * self.mean(self.judged)

    @property
    def faulty(self) -> bool:
        """Whether a fault must be fixed before more motion can help."""
        return any(cause.level != GOOD for cause in self.causes)

    @property
    def drowned(self) -> Array:
        """Joints whose torque is below its noise, so that nMSE does not assess the model, (J,)."""
        drowned = self.noise & (self.judged.nmse > thresholds.GOOD_JOINT_NMSE)
        return drowned & ~drowned.all()

    def mean(self, errors: Score) -> float:
        """Mean nMSE over the joints above their noise."""
        return float(errors.nmse[..., ~self.drowned].mean())

    @property
    def judged(self) -> Score:
        """Errors that the verdict uses: held-out ones, or else training ones."""
        return self.held_out or self.train

    def joint(self, j: int) -> str:
        """Number and name of joint j."""
        return f"joint {j + 1} ({self.arm.joint_names[j]})"


def _held_out(quality: Quality) -> Iterator[Finding]:
    if quality.copied:
        yield Finding(USABLE, quality.copied)
    elif quality.held_out is None:
        yield Finding(USABLE, "no recording was held out: prediction of other motions is untested")
    else:
        tested, trained = quality.mean(quality.held_out), quality.mean(quality.train)
        if tested > max(thresholds.OVERFITTED * trained, thresholds.GOOD_NMSE / 2):
            ratio = f"validation nMSE is {tested / trained:.1f} times that of training"
            advice = "" if quality.faulty else ": add more, or more varied, recordings"
            yield Finding(USABLE, ratio + advice)
    if quality.folds and quality.mean(quality.folds) > thresholds.GOOD_NMSE:
        errors = quality.folds.nmse[:, ~quality.drowned].mean(1)
        bad = f"recording {errors.argmax() + 1} is predicted by the others with mean nMSE {errors.max():.3f}"
        yield Finding(USABLE, bad)


def _misfits(quality: Quality) -> Iterator[Finding]:
    judged = quality.judged
    where = quality.where
    drowned = quality.drowned.tolist()
    if (mean := quality.mean(judged)) > thresholds.GOOD_NMSE:
        others = " of the other joints" if any(drowned) else ""
        level = _level(mean, thresholds.USABLE_NMSE)
        yield Finding(level, f"mean nMSE{others} is {mean:.3g} on {where}")
    for j, error in enumerate(judged.nmse.tolist()):
        if drowned[j]:
            yield _drowned(quality, j)
        elif error > thresholds.GOOD_JOINT_NMSE:
            left = f"the model leaves {error:.0%} of the torque's variance unexplained"
            yield Finding(_level(error, thresholds.USABLE_JOINT_NMSE), f"{left} on {where}", j)


def _drowned(quality: Quality, j: int) -> Finding:
    """Finding on a joint whose torque is below its noise: its error is compared with its torque limit."""
    unit = "N" if quality.arm.prismatic[j] else "N·m"
    limit = quality.arm.torque_limit[j]
    usual, noise, share = (x[j] for x in (quality.usual, quality.judged.rmse, quality.torque_deviation))
    text = f"the residual is noise of {noise:.2g} {unit}, for a usual torque of {usual:.2g} {unit}"
    if math.isfinite(limit):
        text += f" and a limit of {limit:.3g} {unit}"
        level = _level(share * usual, thresholds.USABLE_NOISE * limit)
    else:
        level = _level(share, thresholds.USABLE_UNCERTAINTY)
    uncertain = f"torque in other motions is uncertain by {share * usual:.2g} {unit}"
    advice = "repetitions or a longer recording reduce that, a larger motion does not"
    return Finding(level, f"{text}; {uncertain}: {advice}", j)


def _excitation(quality: Quality) -> Iterator[Finding]:
    condition = quality.estimate.condition
    if math.isinf(condition):
        yield Finding(USABLE, "the arm is poorly excited: some parameters have no effect in this motion")
    elif condition > thresholds.GOOD_CONDITION:
        alike = f"condition number {condition:.0f} of the scaled regressor"
        yield Finding(USABLE, f"the arm is poorly excited: parameters are hard to tell apart ({alike})")
    for j, share in enumerate(quality.torque_deviation.tolist()):
        if quality.drowned[j]:
            continue
        weak = listed([name for name in quality.weak if joint_of(name) == j], _NAMED)
        if share > thresholds.GOOD_UNCERTAINTY:
            level = _level(share, thresholds.USABLE_UNCERTAINTY)
            size = f"{share:.0%}" if share < _MOST else f"more than {_MOST:.0%}"
            text = f"not identifiable from this data, torque in other motions is uncertain by {size}"
            names = f" ({weak})" if weak else ""
            yield Finding(level, f"{text}{names}", j)
        elif weak:
            yield Finding(USABLE, f"{weak} cannot be determined", j)


def _negative(quality: Quality) -> Iterator[Finding]:
    estimate = quality.estimate
    each = zip(estimate.names, estimate.parameters.tolist(), estimate.deviation.tolist())
    shaped = {joint_of(name) for name in estimate.names if name.startswith(_SHAPED)}
    signed = [
        entry
        for entry in each
        if entry[0].rstrip("0123456789") in _FRICTION and joint_of(entry[0]) not in shaped
    ]
    clear = -NormalDist().inv_cdf(NormalDist().cdf(-thresholds.NEGATIVE) / max(1, len(signed)))  # Bonferroni
    for name, value, deviation in signed:
        if value < -clear * deviation:
            what = "rotor inertia" if name.startswith("Ia") else "friction"
            text = f"{name} is {value:.2g} ± {deviation:.1g}, but {what} cannot be negative"
            yield Finding(USABLE, text, joint_of(name))


def _level(value: float, usable: float) -> str:
    """The best verdict that a value allows which is not good."""
    return BAD if value > usable else USABLE


def joint_of(name: str) -> int:
    """Index of the joint or link, from 0, whose number ends a parameter's name."""
    return int(name.lstrip(ascii_letters)) - 1
