"""A model's misfit, which every cause is sought in."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

from sidegan.base.arrays import Array
from sidegan.identification import thresholds
from sidegan.identification.estimate import estimate, nmse_text, score
from sidegan.identification.identified import IdentifiedArm, measurements_of
from sidegan.identification.measurements import Measurements
from sidegan.identification.model import TorqueModel
from sidegan.recording.agreement import Agreement, agreement_of


class Misfit:
    """The misfit of an identified arm.

    A cause is a function of it that changes the data or the model, fits anew, and returns findings: what is
    wrong, and what to do about it. It returns none if the change does not explain the misfit.
    """

    def __init__(self, found: IdentifiedArm) -> None:
        self.found = found
        self.model, self.arm, self.quality = found.model, found.model.arm, found.quality
        self.samples = measurements_of(found.training)
        self.nmse = self.quality.mean(self.quality.judged)  # over the joints above their noise, as ``error``

    @cached_property
    def agreement(self) -> Agreement:
        """Agreement of the training recordings with the description."""
        segments = [segment for recording in self.found.training for segment in recording.segments]
        return agreement_of(self.model.body, segments, self.found.training[0].agreement.settings)

    def error(self, model: TorqueModel | None = None, zeros: Array | float = 0.0) -> float:
        """Mean nMSE of the chosen method with another model or zeros, over the joints above their noise."""
        found, model = self.found, model or self.model
        samples, held_out = (
            shift_positions(measurements_of(x), zeros) for x in (found.training, found.validation)
        )
        parameters = estimate(found.chosen.method, model, samples).parameters
        return self.quality.mean(score(model, parameters, held_out or samples))

    def least_mass(self, deviation: float) -> float:
        """Mass [kg] from which a load or a difference of a link counts, by the deviation of what is found."""
        notable = thresholds.NOTABLE_MASS * self.arm.inertial_parameters[:, 0].sum()
        return max(thresholds.CERTAIN * deviation, notable)

    def instead(self, error: float) -> str:
        """Words on the mean nMSE that another model or other data would have."""
        return f"mean nMSE would then be {nmse_text(error)} instead of {nmse_text(self.nmse)}"


def shift_positions(samples: Sequence[Measurements], zeros: Array | float) -> list[Measurements]:
    """Samples whose positions count from other zeros [rad or m], (J,)."""
    return [replace(x, position=x.position - zeros) for x in samples]
