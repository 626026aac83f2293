"""From checked recordings to estimates, their test errors and a verdict: the identification of a real arm."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import torch
from torch import Tensor

from sidegan.errors import InfeasibleError, RecordingError, ShapeError
from sidegan.identification.estimate import Estimate, estimate
from sidegan.identification.lacking import Lacks, lacks
from sidegan.identification.measurements import Measurements, halves_of, joined
from sidegan.identification.model import Terms, TorqueModel
from sidegan.identification.prior import typical
from sidegan.identification.score import Score, folds, score, shown
from sidegan.identification.settings import EstimationSettings
from sidegan.identification.stribeck import stribeck_velocities
from sidegan.identification.trust import trust
from sidegan.identification.verdict import Trust, implausible_links
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.agreement import agreement_of
from sidegan.recording.check import CheckedRecording
from sidegan.robot import Arm, Drives

EQUAL_WEIGHTS, CONSISTENT = "ols", "consistent"  # methods that every identification is compared with
_AS_GOOD = 1.1  # times the other model's nMSE, up to which the one that can exist is preferred
_PERFECT = 1e-4  # nMSE below which no model is better than another


@dataclass(frozen=True, eq=False)
class IdentifiedArm:
    """A model identified from recordings, with everything that is known about its quality."""

    model: TorqueModel  # what torque is explained with
    training: list[CheckedRecording]  # recordings that were identified from
    validation: list[CheckedRecording]  # recordings that were held out
    kind: str  # what the tests below were made on
    # by method: the chosen one first, then equal weights and the consistent one
    estimates: dict[str, Estimate]
    tests: dict[str, Score]  # errors of each of them on what it had not seen, where there was something
    trained: dict[str, Score]  # errors of each of them on what it was identified from
    trust: Trust  # whether to trust the model that is to be used
    # method of that model: the consistent one unless the chosen one predicts what it has not seen better
    use: str
    # nMSE (J,) by which that was decided where nothing was held out; nothing where halves told too little
    halves: dict[str, Tensor]

    @property
    def recordings(self) -> list[CheckedRecording]:
        """All recordings, those that were identified from first."""
        return [*self.training, *self.validation]

    @property
    def standard(self) -> Tensor:
        """Physically consistent parameters in ``TorqueModel.standard_names``' order, (F,)."""
        standard = self.estimates[CONSISTENT].standard
        assert standard is not None, "that is what this method gives"
        return standard

    @property
    def links(self) -> Tensor:
        """Physically consistent link parameters in Pinocchio's order, (J, 10)."""
        return self.model.links_of(self.standard)

    @property
    def used_standard(self) -> Tensor:
        """Standard parameters of the model to use, (F,): the nearest to the consistent ones that give it.

        They have its torques exactly; where it is not the consistent one, some of its links cannot exist.
        """
        if self.use == CONSISTENT:
            return self.standard
        return nearest_standard(self.model, self.standard, self.used.parameters)

    @cached_property
    def drives(self) -> Drives:
        """Friction and rotors of the consistent model; none of a kind that it has not."""
        drives = vars(Drives.none(self.model.joints))
        found = {kind: self.standard[self.model.standard_slice(kind)] for kind in self.model.kinds}
        return Drives(**{kind: found.get(kind, none).clamp_min(0.0) for kind, none in drives.items()})

    @cached_property
    def lacks(self) -> Lacks:
        """What the residuals of the chosen method show of torques that the model lacks."""
        return lacks(self.model, self.chosen, measurements_of(self.training))

    @property
    def left_over(self) -> list[str]:
        """What that is, a sentence for each joint that shows something."""
        return self.lacks.said(self.joint_names, self.trust.torque_deviation)

    @property
    def wanted_motions(self) -> list[str]:
        """Motions that would help where it makes more of an error than noise does."""
        return self.lacks.motions(self.joint_names, self.trust.torque_deviation)

    @property
    def joint_names(self) -> list[str]:
        """What to call the joints."""
        return [self.trust.joint(j) for j in range(self.model.joints)]

    @property
    def unseen(self) -> dict[str, Tensor]:
        """NMSE on what was not seen, (J,), by method; nothing where there is no such error."""
        return _unseen(self.tests, self.trained, self.halves)

    @property
    def chosen(self) -> Estimate:
        """Estimate of the chosen method."""
        return self.trust.estimate

    @property
    def used(self) -> Estimate:
        """Estimate of the model to use."""
        return self.estimates[self.use]


def nearest_standard(model: TorqueModel, standard: Tensor, parameters: Tensor) -> Tensor:
    """Standard parameters, (F,), that give a model's parameters (P,) and differ least from others, (F,).

    Differences count in each link's typical mass and length, and those of terms alike.
    """
    links = typical(model.arm).reshape(-1)
    scale = torch.cat([links, torch.ones(len(standard) - len(links), dtype=torch.float64)])
    rows = model.mapping * scale
    return standard + scale * (torch.linalg.pinv(rows) @ (parameters - model.mapping @ standard))


def measurements_of(recordings: Iterable[CheckedRecording]) -> list[Measurements]:
    """Measurements of recordings, one for each stretch without gaps."""
    return [Measurements(*segment[1:]) for recording in recordings for segment in recording.segments]


def model_of(arm: Arm, terms: Terms, samples: list[Measurements]) -> TorqueModel:
    """Model of an arm with terms of friction; velocities of a Stribeck term are found from the samples."""
    body = RigidBody(arm)
    if not terms.stribeck:
        return TorqueModel(body, terms)
    plain = TorqueModel(body, replace(terms, stribeck=False))
    return TorqueModel(body, terms, stribeck_velocities(plain, samples))


def identify_arm(
    arm: Arm,
    training: list[CheckedRecording],
    validation: list[CheckedRecording],
    terms: Terms,
    settings: EstimationSettings,
) -> IdentifiedArm:
    """Model identified from recordings and tested on what was held out, or else on the recordings in turn.

    Raises:
        RecordingError: when there are fewer equations than parameters.
    """
    samples, held_out = measurements_of(training), measurements_of(validation)
    model, methods = model_of(arm, terms, samples), _methods(settings)
    count = sum(map(len, samples))
    if count * model.joints < model.count:
        raise RecordingError(
            f"{count} samples of {model.joints} joints are left, too few for {model.count} parameters"
        )
    estimates = {method: estimate(method, model, samples, **values) for method, values in methods.items()}
    trained = {method: score(model, one.parameters, samples) for method, one in estimates.items()}
    kind, tests, turns = "in sample: nothing was held out", trained, dict[str, Score]()
    if held_out:
        kind = "held out"
        tests = {method: score(model, one.parameters, held_out) for method, one in estimates.items()}
    elif len(training) > 1:
        kind = f"each of {len(training)} recordings, predicted from the others"
        whole = [joined(measurements_of([recording])) for recording in training]
        turns = {method: folds(method, model, whole, **values) for method, values in methods.items()}
        tests = {method: one.pooled for method, one in turns.items()}
    halves = _halves(model, samples, methods, settings.method) if tests is trained else {}
    use = preferred(settings.method, _unseen(tests, trained, halves))
    chosen = estimates[settings.method]
    trusted = trust(model, chosen, held_out or None, turns.get(use))
    trusted = replace(trusted, train=trained[use], validation=tests[use] if held_out else None)
    found = IdentifiedArm(model, training, validation, kind, estimates, tests, trained, trusted, use, halves)
    return replace(found, trust=_doubted(found, held_out or samples, methods[settings.method]))


def _doubted(found: IdentifiedArm, tested: list[Measurements], settings: dict[str, Any]) -> Trust:
    """What is known of an identified arm, with what speaks against description, torques or links."""
    model, links = found.model, found.links
    told = (model.mapping[:, : links.numel() : links.shape[1]] != 0).any(0)
    masses = float(links[told, 0].sum()), float(model.arm.inertial_parameters[told, 0].sum())
    agreement = agreement_of(model.body, [x for recording in found.training for x in recording.segments])
    turned = agreement.gravity(model.arm)
    if turned is not None:
        error = _error_with(agreement.load.gravity, found, tested, settings)
        turned += f"; mean nMSE would be {shown(error)} then, it is {shown(found.trust.judged.nmse_mean)}"
    return replace(
        found.trust,
        mass=masses,
        doubts=tuple(agreement.doubts(model.arm)),
        turned=turned,
        implausible=tuple(one for one in implausible_links(model.arm, links) if told[one.joint]),
    )


def _error_with(
    gravity: Tensor, found: IdentifiedArm, tested: list[Measurements], settings: dict[str, Any]
) -> float:
    """Mean nMSE of the chosen method's model if gravity in the arm's world [m/s²], (3,), were another."""
    model = found.model
    body = RigidBody(replace(model.arm, gravity=gravity))
    other = TorqueModel(body, model.terms, None if model.stribeck is None else model.stribeck.tolist())
    fit = estimate(found.chosen.method, other, measurements_of(found.training), **settings)
    return score(other, fit.parameters, tested).nmse_mean


def preferred(method: str, errors: Mapping[str, Tensor]) -> str:
    """The model to use, by the nMSE of each, (J,): one that can exist, unless another is clearly better.

    Joints count alike, by the ratio of their errors. Without any errors on what was not seen, the one that
    can exist.
    """
    if not errors:
        return CONSISTENT
    existing, other = (errors[name].clamp_min(_PERFECT) for name in (CONSISTENT, method))
    return method if float((existing / other).log().mean().exp()) > _AS_GOOD else CONSISTENT


def _unseen(
    tests: Mapping[str, Score], trained: Mapping[str, Score], halves: Mapping[str, Tensor]
) -> dict[str, Tensor]:
    """NMSE on what was not seen, (J,), by method: held out, or halves by each other where nothing was."""
    if halves or tests is trained:
        return dict(halves)
    return {method: one.nmse for method, one in tests.items()}


def _halves(
    model: TorqueModel, samples: list[Measurements], methods: dict[str, dict[str, Any]], method: str
) -> dict[str, Tensor]:
    """NMSE of each half of the recordings by the other, (J,), of a method and the consistent one.

    Nothing where a half tells too little.
    """
    try:
        halves = halves_of(samples)
        each = {name: folds(name, model, halves, **methods[name]) for name in (method, CONSISTENT)}
    except (InfeasibleError, ShapeError):
        return {}
    return {name: one.pooled.nmse for name, one in each.items()}


def _methods(settings: EstimationSettings) -> dict[str, dict[str, Any]]:
    """Settings by method: the chosen one first, then those that it is compared with."""
    names = ("strength", "margin", "total_mass")
    methods: dict[str, dict[str, Any]] = {settings.method: dict(settings.settings or {})}
    methods.setdefault(EQUAL_WEIGHTS, {})
    return methods | {CONSISTENT: {name: getattr(settings, name) for name in names}}
