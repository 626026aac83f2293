"""Identification of a real arm: from checked recordings to estimates, their errors and a verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from sidegan.base.arrays import TINY, geometric_mean
from sidegan.errors import RecordingError
from sidegan.identification import thresholds
from sidegan.identification.causes import causes_of
from sidegan.identification.estimate import Estimate, Score, estimate, score
from sidegan.identification.evidence import effects_of
from sidegan.identification.fit import best_combination, spread_of
from sidegan.identification.identified import CONSISTENT, EQUAL_WEIGHTS, IdentifiedArm, measurements_of
from sidegan.identification.measurements import Measurements
from sidegan.identification.model import Terms, TorqueModel
from sidegan.identification.residuals import is_noise
from sidegan.identification.settings import EstimationSettings
from sidegan.identification.verdict import BAD, USABLE, Finding, Quality
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.checked import CheckedRecording
from sidegan.robot import Arm


def identify_arm(
    arm: Arm,
    training: list[CheckedRecording],
    validation: list[CheckedRecording],
    terms: Terms,
    settings: EstimationSettings,
) -> IdentifiedArm:
    """Identify from training recordings; test on validation, or else on each recording in turn.

    Effects on single joints are sought if no fault explains the errors, so that they do not hide one.
    """
    model = TorqueModel(RigidBody(arm), terms)
    count = sum(map(len, measurements_of(training)))
    if count * model.joints < model.count:
        few = f"{count} samples of {model.joints} joints are left"
        raise RecordingError(f"{few}, too few for {model.count} parameters")
    plain = _judged(model, training, validation, settings)
    if terms.effects == "none" or (plain.quality.faulty and terms.effects == "auto"):
        return plain
    wanted = None if terms.effects == "auto" else terms.effects
    effects, each = effects_of(model, [measurements_of([recording]) for recording in training], wanted)
    if effects is None:
        return plain
    result = _judged(TorqueModel(model.body, terms, effects), training, validation, settings)
    result = replace(result, effects=each)
    if plain.quality.verdict != BAD or result.quality.verdict == BAD:
        return result
    doubt = Finding(USABLE, f"not trustworthy without its effects on joints: {plain.quality.reasons[0]}")
    return replace(result, quality=replace(result.quality, causes=(*result.quality.causes, doubt)))


def _judged(
    model: TorqueModel,
    training: list[CheckedRecording],
    validation: list[CheckedRecording],
    settings: EstimationSettings,
) -> IdentifiedArm:
    """A model's estimates, errors and verdict."""
    samples, held_out = measurements_of(training), measurements_of(validation)
    strength = settings.strength
    methods = dict.fromkeys((settings.method, EQUAL_WEIGHTS, CONSISTENT))
    estimates = {method: estimate(method, model, samples, strength) for method in methods}
    trained = {method: score(model, fit.parameters, samples) for method, fit in estimates.items()}
    kind, where = "in sample: nothing was held out", "training data"
    tested = trained
    turns: dict[str, Score] = {}
    if held_out:
        kind, where = "held out", "validation data"
        tested = {method: score(model, fit.parameters, held_out) for method, fit in estimates.items()}
    elif len(training) > 1:
        kind = f"each of {len(training)} recordings, predicted from the others"
        where = "each recording by the others"
        each = [measurements_of([recording]) for recording in training]
        turns = {method: cross_validate(method, model, each, strength) for method in estimates}
        tested = {method: errors.pooled for method, errors in turns.items()}
    copied = next((x.copied for x in validation or training if x.copied), None)
    kind = "of the same run: nothing was held out" if copied else kind
    use = CONSISTENT if tested is trained else recommended_method(settings.method, tested)
    used = estimates[use]
    sets = [recordings for recordings in (training, validation) if recordings]
    noise = [is_noise(model, used.parameters, used.covariance, recordings) for recordings in sets]
    judged = Quality(
        arm=model.arm,
        estimate=estimates[settings.method],
        train=trained[use],
        held_out=None if tested is trained else tested[use],
        where=where,
        folds=turns.get(use),
        noise=np.all(noise, 0),
        copied=copied,
        **assess(model, estimates[settings.method], held_out or samples),
    )
    found = IdentifiedArm(
        model=model,
        training=training,
        validation=validation,
        estimates=estimates,
        trained=trained,
        tested=tested,
        kind=kind,
        use=use,
        quality=judged,
    )
    causes, gravity = causes_of(found)
    return replace(found, quality=replace(judged, causes=tuple(causes), other_gravity=gravity))


def cross_validate(
    method: str, model: TorqueModel, recordings: Sequence[list[Measurements]], strength: float | None = None
) -> Score:
    """Errors, (K, J), of predicting each of K recordings with the model identified from the others."""
    rows = []
    for k, held_out in enumerate(recordings):
        others = chain(*recordings[:k], *recordings[k + 1 :])
        rows.append(score(model, estimate(method, model, others, strength).parameters, held_out))
    return Score(*(np.stack(column) for column in zip(*rows)))


def assess(model: TorqueModel, estimate: Estimate, samples: list[Measurements]) -> dict[str, Any]:
    """Effects of an estimate's errors on torques, and errors of the description's links on samples.

    As the fields of ``Quality``; friction, rotors and offsets are fitted to the description's links.
    """
    y = model.regressor(*model.usual_states())
    usual = np.maximum(np.sqrt(np.square(y @ estimate.parameters).mean(0)), TINY)
    share = np.sqrt(np.square(y).mean(0)) / usual[:, None]  # effect of a unit of each parameter, (J, P)
    effect = share.max(0) * estimate.deviation
    weak = [i for i in (-effect).argsort().tolist() if effect[i] > thresholds.WEAK]
    nominal, *_ = best_combination(estimate.sums, estimate.weights, model.nominal, model.terms_mapping)
    return {
        "nominal_score": score(model, nominal, samples),
        "torque_deviation": np.sqrt(spread_of(y, estimate.covariance) / len(y)) / usual,
        "usual": usual,
        "weak": tuple(estimate.names[i] for i in weak),
    }


def recommended_method(method: str, errors: Mapping[str, Score]) -> str:
    """The recommended method, by errors: the consistent one, unless the other is clearly better."""
    return method if error_ratio(method, errors) > thresholds.AS_GOOD else CONSISTENT


def error_ratio(method: str, errors: Mapping[str, Score]) -> float:
    """Ratio of the consistent model's nMSE to that of another method, geometric mean over joints."""
    consistent, other = (np.maximum(errors[name].nmse, thresholds.SAME_NMSE) for name in (CONSISTENT, method))
    return geometric_mean(consistent / other)
