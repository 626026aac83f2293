"""From configured files to estimates and their test: the rooms in the order in which an arm is identified."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from torch import Tensor

from sidegan.errors import ConfigError, RecordingError
from sidegan.identification import Measurements, Terms, TorqueModel
from sidegan.identification.estimate import Estimate, estimate
from sidegan.identification.next_runs import grams_of
from sidegan.identification.score import Folds, Score, folds, score
from sidegan.identification.stribeck import stribeck_velocities
from sidegan.identification.trust import Trust, trust
from sidegan.library import Library
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.config import Config
from sidegan.pipeline.stages.identify_read import Examined
from sidegan.robot import Arm


@dataclass(frozen=True, eq=False)
class Tested:
    """Errors of an estimate on recordings.

    Attributes:
        nmse: normalised mean squared error, (J,).
        rmse: [N·m or N], (J,).
    """

    nmse: Tensor
    rmse: Tensor

    @classmethod
    def of(cls, found: Score) -> "Tested":
        """On all recordings together."""
        return cls(found.nmse, found.rmse)

    @classmethod
    def over(cls, found: Folds) -> "Tested":
        """Mean over recordings that took turns."""
        return cls(found.nmse.mean(0), found.rmse.square().mean(0).sqrt())


@dataclass(frozen=True, eq=False)
class Fitted:
    """Everything that was found.

    Attributes:
        model: what torque is explained with.
        training: recordings that were identified from.
        validation: recordings that were held out.
        kind: what the tests below were made on.
        estimates: by method: the one that was chosen, first, then equal weights and the consistent one.
        tests: of each of them on what it had not seen, where there was something.
        trained: of each of them on what it was identified from.
        standard: physically consistent parameters in ``TorqueModel.standard_names``' order, (F,).
        trust: whether to trust the estimate of the chosen method.
    """

    model: TorqueModel
    training: list[Examined]
    validation: list[Examined]
    kind: str
    estimates: dict[str, Estimate]
    tests: dict[str, Tested]
    trained: dict[str, Tested]
    standard: Tensor
    trust: Trust

    @property
    def links(self) -> Tensor:
        """Physically consistent link parameters in Pinocchio's order, (J, 10)."""
        return self.standard[: 10 * self.model.joints].reshape(-1, 10)

    @property
    def method(self) -> str:
        """The method that was chosen."""
        return next(iter(self.estimates))

    @property
    def chosen(self) -> Estimate:
        """Its estimate."""
        return self.estimates[self.method]


def fitted(cfg: Config, arm: Arm, training: list[Examined], validation: list[Examined]) -> Fitted:
    """Identify from recordings and test on what was held out, or else over the recordings in turn.

    Raises:
        RecordingError: when there are fewer equations than parameters.
        ConfigError: when a setting of the method is impossible.
    """
    samples = [part for one in training for part in one.measurements]
    model = model_of(cfg.model, arm, samples)
    _refuse_short(model, samples)
    settings: dict[str, dict[str, Any]] = {cfg.identify.method: dict(cfg.identify.settings)}
    settings.setdefault("ols", {})
    settings["consistent"] = {
        name: getattr(cfg.identify, name) for name in ("pull", "strength", "margin", "total_mass")
    }
    estimates = {method: estimate(method, model, samples, **values) for method, values in settings.items()}
    standard = estimates["consistent"].standard
    if standard is None:
        raise ConfigError("the consistent estimate has no link parameters")
    trained = {name: Tested.of(score(model, one.parameters, samples)) for name, one in estimates.items()}
    held_out = [part for one in validation for part in one.measurements] or None
    turns: dict[str, Folds] = {}
    kind, tests = "in sample: nothing was held out", trained
    if held_out:
        kind = "held out"
        tests = {name: Tested.of(score(model, one.parameters, held_out)) for name, one in estimates.items()}
    elif len(training) > 1:
        kind = f"each of {len(training)} recordings, predicted from the others"
        parts = [one.whole for one in training]
        turns = {method: folds(method, model, parts, **values) for method, values in settings.items()}
        tests = {method: Tested.over(found) for method, found in turns.items()}
    chosen = estimates[cfg.identify.method]
    runs = next_runs(cfg, model, chosen, training[0].findings.grid.rate)
    judged = trust(model, chosen, held_out, turns.get(cfg.identify.method), **runs)
    return Fitted(model, training, validation, kind, estimates, tests, trained, standard, judged)


def next_runs(cfg: Config, model: TorqueModel, chosen: Estimate, rate: float) -> dict[str, Any]:
    """What ``trust`` needs to recommend trajectories, recorded at ``rate`` [Hz]; nothing without a library.

    Raises:
        ArtifactError: when the library is damaged or another arm's.
    """
    if cfg.identify.library is None:
        return {}
    library = Library.load(Path(cfg.identify.library), model.arm)
    c = library.coefficients
    trajectory = Trajectory(model.joints, c.shape[2], library.period, library.home or None)
    grams = grams_of(model, chosen, trajectory, c)
    samples = max(1, round(rate * library.period))
    return {"grams": grams, "samples_each": samples, "count": cfg.identify.recommend}


def model_of(terms: Terms, arm: Arm, samples: list[Measurements]) -> TorqueModel:
    """The model of an arm that is configured; velocities of a Stribeck term are found from the samples."""
    plain = TorqueModel(RigidBody(arm), replace(terms, stribeck=False))
    if not terms.stribeck:
        return plain
    return TorqueModel(plain.body, terms, stribeck_velocities(plain, samples))


def _refuse_short(model: TorqueModel, samples: list[Measurements]) -> None:
    count = sum(map(len, samples))
    if count * model.joints < model.count:
        raise RecordingError(
            f"{count} samples of {model.joints} joints are left, too few for {model.count} parameters"
        )
