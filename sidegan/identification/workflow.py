"""Identification of a real arm: checked recordings to estimates, their errors, and a verdict."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import InfeasibleError, RecordingError, ShapeError
from sidegan.identification.causes import causes_of
from sidegan.identification.estimate import estimate
from sidegan.identification.identified import (
    CONSISTENT,
    EQUAL_WEIGHTS,
    Choice,
    IdentifiedArm,
    Tested,
    measurements_of,
)
from sidegan.identification.measurements import Measurements
from sidegan.identification.model import Terms, TorqueModel
from sidegan.identification.noise import is_noise
from sidegan.identification.quality import quality
from sidegan.identification.score import Score, folds, score
from sidegan.identification.settings import EstimationSettings
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.check import CheckedRecording
from sidegan.robot import Arm

Methods = dict[str, dict[str, Any]]  # settings by method, the chosen one first

_AS_GOOD = 1.1  # times the other model's nMSE, up to which the one that can exist is preferred
_PERFECT = 1e-4  # nMSE below which no model is better than another


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
    model = TorqueModel(RigidBody(arm), terms)
    methods: Methods = {settings.method: {}, EQUAL_WEIGHTS: {}, CONSISTENT: {"strength": settings.strength}}
    if (count := sum(map(len, samples))) * model.joints < model.count:
        few = f"{count} samples of {model.joints} joints are left"
        raise RecordingError(f"{few}, too few for {model.count} parameters")
    estimates = {method: estimate(method, model, samples, **more) for method, more in methods.items()}
    trained = {method: score(model, one.parameters, samples) for method, one in estimates.items()}
    kind, tests, turns = "in sample: nothing was held out", trained, dict[str, Score]()
    if held_out:
        kind = "held out"
        tests = {method: score(model, one.parameters, held_out) for method, one in estimates.items()}
    elif len(training) > 1:
        kind = f"each of {len(training)} recordings, predicted from the others"
        each = [measurements_of([recording]) for recording in training]
        turns = {method: folds(method, model, each, **more) for method, more in methods.items()}
        tests = {method: one.pooled for method, one in turns.items()}
    unseen, how = {method: one.nmse for method, one in tests.items()}, kind
    if tests is trained:
        unseen, how = _halves(model, samples, methods), "on halves by each other"
    use = preferred(settings.method, unseen)
    judged = quality(model, estimates[settings.method], held_out or None, turns.get(use))
    judged = replace(judged, train=trained[use], validation=tests[use] if held_out else None)
    sets = [one for one in (training, validation) if one]
    used = model, estimates[use].parameters, estimates[use].covariance
    judged = replace(judged, noise=np.all([is_noise(*used, recordings) for recordings in sets], 0))
    found = IdentifiedArm(
        model=model,
        training=training,
        validation=validation,
        estimates=estimates,
        tests=Tested(kind, tests),
        trained=trained,
        quality=judged,
        choice=Choice(use, unseen, how),
    )
    causes, gravity = causes_of(found)
    return replace(found, quality=replace(judged, causes=tuple(causes), other_gravity=gravity))


def preferred(method: str, errors: Mapping[str, Array]) -> str:
    """The model to use, by the nMSE of each, (J,): one that can exist, unless another is clearly better.

    Joints count alike, by the ratio of their errors. Without any errors on what was not seen, the one that
    can exist.
    """
    if not errors:
        return CONSISTENT
    existing, other = (np.maximum(errors[name], _PERFECT) for name in (CONSISTENT, method))
    return method if np.exp(np.log(existing / other).mean()) > _AS_GOOD else CONSISTENT


def _halves(model: TorqueModel, samples: list[Measurements], methods: Methods) -> dict[str, Array]:
    """NMSE of each half of the recordings by the other, (J,), of the chosen method and the consistent one.

    Empty where a half determines too little.
    """
    halves = (
        [sample[: len(sample) // 2] for sample in samples],
        [sample[len(sample) // 2 :] for sample in samples],
    )
    names = next(iter(methods)), CONSISTENT
    try:
        return {name: folds(name, model, halves, **methods[name]).pooled.nmse for name in names}
    except (InfeasibleError, ShapeError):
        return {}
