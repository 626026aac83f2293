"""From checked recordings to estimates, their test errors and a verdict: the identification of a real arm."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from pathlib import Path
from typing import Any, NamedTuple

from torch import Tensor

from sidegan.errors import ConfigError, RecordingError
from sidegan.identification.estimate import Estimate, estimate
from sidegan.identification.measurements import Measurements
from sidegan.identification.model import TorqueModel
from sidegan.identification.next_runs import grams_of
from sidegan.identification.score import folds, score
from sidegan.identification.stribeck import stribeck_velocities
from sidegan.identification.terms import Terms
from sidegan.identification.trust import Trust, trust
from sidegan.library import Library
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.recording.check import CheckedRecording
from sidegan.robot import Arm

EQUAL_WEIGHTS, CONSISTENT = "ols", "consistent"  # methods that every identification is compared with


class Errors(NamedTuple):
    """Errors of predicted torques."""

    nmse: Tensor  # normalised mean squared error, (J,)
    rmse: Tensor  # [N·m or N], (J,)


class Candidates(NamedTuple):
    """Library of trajectories to recommend from, and how many of them."""

    library: Path
    recommend: int


@dataclass(frozen=True, eq=False)
class IdentifiedArm:
    """A model identified from recordings, with everything that is known about its quality."""

    model: TorqueModel  # what torque is explained with
    training: list[CheckedRecording]  # recordings that were identified from
    validation: list[CheckedRecording]  # recordings that were held out
    kind: str  # what the tests below were made on
    # by method: the chosen one first, then equal weights and the consistent one
    estimates: dict[str, Estimate]
    tests: dict[str, Errors]  # errors of each of them on what it had not seen, where there was something
    trained: dict[str, Errors]  # errors of each of them on what it was identified from
    standard: Tensor  # physically consistent parameters in ``TorqueModel.standard_names``' order, (F,)
    trust: Trust  # whether to trust the estimate of the chosen method

    @property
    def links(self) -> Tensor:
        """Physically consistent link parameters in Pinocchio's order, (J, 10)."""
        return self.standard[: 10 * self.model.joints].reshape(-1, 10)

    @property
    def method(self) -> str:
        """Name of the chosen method."""
        return next(iter(self.estimates))

    @property
    def chosen(self) -> Estimate:
        """Estimate of the chosen method."""
        return self.estimates[self.method]


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
    model: TorqueModel,
    training: list[CheckedRecording],
    validation: list[CheckedRecording],
    methods: Mapping[str, Mapping[str, Any]],
    candidates: Candidates | None = None,
) -> IdentifiedArm:
    """Model identified from recordings and tested on what was held out, or else on the recordings in turn.

    Args:
        model: what torque is explained with.
        training: recordings to identify from.
        validation: recordings to test with.
        methods: settings by method, the chosen one first; those for equal weights and the consistent
            parameters among them.
        candidates: trajectories to recommend from, where the recordings fall short.

    Raises:
        RecordingError: when there are fewer equations than parameters.
        ConfigError: when a setting of a method is impossible.
        ArtifactError: when the library is damaged or another arm's.
    """
    samples, held_out = measurements_of(training), measurements_of(validation)
    _refuse_short(model, samples)
    estimates = {method: estimate(method, model, samples, **values) for method, values in methods.items()}
    standard = estimates[CONSISTENT].standard
    if standard is None:
        raise ConfigError("the consistent estimate has no link parameters")
    trained = _scores(model, estimates, samples)
    kind, tests, turns = "in sample: nothing was held out", trained, None
    if held_out:
        kind, tests = "held out", _scores(model, estimates, held_out)
    elif len(training) > 1:
        kind = f"each of {len(training)} recordings, predicted from the others"
        whole = [reduce(Measurements.append, measurements_of([recording])) for recording in training]
        all_turns = {method: folds(method, model, whole, **values) for method, values in methods.items()}
        tests = {m: Errors(x.nmse.mean(0), x.rmse.square().mean(0).sqrt()) for m, x in all_turns.items()}
        turns = next(iter(all_turns.values()))
    chosen = next(iter(estimates.values()))
    runs = _next_runs(model, chosen, training[0].grid.rate, candidates)
    trusted = trust(model, chosen, held_out or None, turns, **runs)
    return IdentifiedArm(model, training, validation, kind, estimates, tests, trained, standard, trusted)


def _scores(
    model: TorqueModel, estimates: dict[str, Estimate], samples: list[Measurements]
) -> dict[str, Errors]:
    """Errors of the estimates on measurements."""
    scores = {method: score(model, one.parameters, samples) for method, one in estimates.items()}
    return {method: Errors(one.nmse, one.rmse) for method, one in scores.items()}


def _next_runs(
    model: TorqueModel, chosen: Estimate, rate: float, candidates: Candidates | None
) -> dict[str, Any]:
    """Arguments of ``trust`` for recommending trajectories, recorded at ``rate`` [Hz]."""
    if candidates is None:
        return {}
    library = Library.load(candidates.library, model.arm)
    c = library.coefficients
    trajectory = Trajectory(model.joints, c.shape[2], library.period, library.home or None)
    samples = max(1, round(rate * library.period))
    return {
        "grams": grams_of(model, chosen, trajectory, c),
        "samples_each": samples,
        "count": candidates.recommend,
    }


def _refuse_short(model: TorqueModel, samples: list[Measurements]) -> None:
    count = sum(map(len, samples))
    if count * model.joints < model.count:
        raise RecordingError(
            f"{count} samples of {model.joints} joints are left, too few for {model.count} parameters"
        )
