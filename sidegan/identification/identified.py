"""An identified arm: its model, estimates of every method, their errors, and the verdict."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sidegan.base.arrays import Array
from sidegan.identification.estimate import Estimate
from sidegan.identification.measurements import Measurements
from sidegan.identification.model import TorqueModel
from sidegan.identification.prior import typical
from sidegan.identification.score import Score
from sidegan.identification.unmodelled import Unmodelled, find_unmodelled
from sidegan.identification.verdict import Quality
from sidegan.recording.check import CheckedRecording
from sidegan.robot import Drives

EQUAL_WEIGHTS, CONSISTENT = "ols", "consistent"  # methods that every identification is compared with


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentifiedArm:
    """A model identified from recordings, with everything that is known about its quality."""

    model: TorqueModel
    training: list[CheckedRecording]  # recordings that were identified from
    validation: list[CheckedRecording]  # recordings that were held out
    estimates: dict[str, Estimate]  # by method: the chosen one, equal weights, the consistent one
    trained: dict[str, Score]  # errors of each method on what it was identified from
    tested: dict[str, Score]  # on what it had not seen, or else the same
    kind: str  # of these: held out, each recording by the others, or in sample
    use: str  # method of the model to use: the consistent one, unless the chosen one predicts clearly better
    quality: Quality  # whether to trust the model to use

    @property
    def recordings(self) -> list[CheckedRecording]:
        """All recordings, those that were identified from first."""
        return [*self.training, *self.validation]

    @property
    def chosen(self) -> Estimate:
        """Estimate of the chosen method."""
        return self.quality.estimate

    @property
    def used(self) -> Estimate:
        """Estimate of the model to use."""
        return self.estimates[self.use]

    @property
    def standard(self) -> Array:
        """Physically consistent parameters in ``TorqueModel.standard_names``' order, (F,)."""
        standard = self.estimates[CONSISTENT].standard
        assert standard is not None, "the consistent method has them"
        return standard

    @property
    def links(self) -> Array:
        """Physically consistent link parameters in Pinocchio's order, (J, 10)."""
        return self.model.links_of(self.standard)

    @property
    def used_standard(self) -> Array:
        """Standard parameters of the model to use, (F,): the nearest to the consistent ones that give it.

        They have its torques exactly; where it is not the consistent one, some of its links cannot exist.
        Differences count in each link's typical mass and length, and those of terms alike.
        """
        if self.use == CONSISTENT:
            return self.standard
        links = typical(self.model.arm).ravel()
        scale = np.concatenate([links, np.ones(len(self.standard) - len(links))])
        mapping = self.model.mapping
        missing = self.used.parameters - mapping @ self.standard
        return self.standard + scale * (np.linalg.pinv(mapping * scale) @ missing)

    @cached_property
    def drives(self) -> Drives:
        """Friction and rotors of the consistent model; zero where it has no such term."""
        drives = vars(Drives.none(self.model.joints))
        found = {kind: self.standard[self.model.standard_slice(kind)] for kind in self.model.kinds}
        return Drives(**{kind: np.maximum(found.get(kind, none), 0.0) for kind, none in drives.items()})

    @cached_property
    def unmodelled(self) -> Unmodelled:
        """Torques that the model lacks, from the residuals of the chosen method."""
        return find_unmodelled(self.model, self.chosen, measurements_of(self.training))

    @property
    def left_over(self) -> list[str]:
        """Torques that are left over, a sentence for each joint that lacks something."""
        names = [self.quality.joint(j) for j in range(self.model.joints)]
        return self.unmodelled.sentences(names, self.quality.torque_deviation)


def measurements_of(recordings: list[CheckedRecording]) -> list[Measurements]:
    """Measurements of recordings, one for each stretch without gaps."""
    return [Measurements(*segment[1:]) for recording in recordings for segment in recording.segments]
