"""An identified arm: its model, each method's estimate and errors, and the verdict."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import Array
from sidegan.identification.effects import EFFECT_KINDS
from sidegan.identification.estimate import Estimate, Score
from sidegan.identification.evidence import Effect
from sidegan.identification.measurements import Measurements
from sidegan.identification.model import TorqueModel, typical
from sidegan.identification.residuals import Unmodelled, find_unmodelled
from sidegan.identification.sums import rows_of
from sidegan.identification.verdict import Quality
from sidegan.recording.checked import CheckedRecording
from sidegan.robot import Drives

EQUAL_WEIGHTS, CONSISTENT = "ols", "consistent"  # methods that every identification also runs


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentifiedArm:
    """A model identified from recordings, and its quality."""

    model: TorqueModel
    training: list[CheckedRecording]
    validation: list[CheckedRecording]  # held out; may be empty
    estimates: dict[str, Estimate]  # by method: the chosen one, equal weights, and consistent
    trained: dict[str, Score]  # training errors by method
    tested: dict[str, Score]  # test errors by method; the training errors if nothing was held out
    kind: str  # of the test: held out, each recording by the others, or in sample
    use: str  # recommended method: consistent, unless the chosen one predicts clearly better
    quality: Quality  # of the recommended model
    effects: Sequence[Effect] = ()  # on single joints, that the model has beyond its terms

    @property
    def recordings(self) -> list[CheckedRecording]:
        """All recordings, training first."""
        return [*self.training, *self.validation]

    @property
    def chosen(self) -> Estimate:
        """Estimate of the chosen method."""
        return self.quality.estimate

    @property
    def used(self) -> Estimate:
        """Estimate of the recommended method."""
        return self.estimates[self.use]

    @property
    def standard(self) -> Array:
        """Physically consistent parameters in ``TorqueModel.standard_names``' order, (F,)."""
        standard = self.estimates[CONSISTENT].standard
        assert standard is not None, "the consistent method sets it"
        return standard

    @property
    def links(self) -> Array:
        """Physically consistent link parameters in Pinocchio's order, (J, 10)."""
        return self.model.links_of(self.standard)

    @property
    def used_standard(self) -> Array:
        """Standard parameters, (F,), that give the recommended model's torques: those nearest to consistent.

        Unless the model is the consistent one, some of their links are physically impossible. Distances are
        in units of each link's typical mass and length; those of terms are not scaled.
        """
        if self.use == CONSISTENT:
            return self.standard
        links = typical(self.model.arm).ravel()
        scale = np.concatenate([links, np.ones(len(self.standard) - len(links))])
        mapping = self.model.mapping
        missing = self.used.parameters - mapping @ self.standard
        return self.standard + scale * (np.linalg.pinv(mapping * scale) @ missing)

    def drives(self, *kinds: str) -> Drives:
        """Friction and rotor inertias of these kinds that fit best beside the consistent links, for a file.

        They make up for the terms that the file cannot hold; kinds that the model lacks are zero.
        """
        model, consistent = self.model, self.estimates[CONSISTENT]
        held = [kind for kind in kinds if kind in model.kinds]
        if not held:
            return Drives.none(model.joints)
        rigid = model.mapping[:, : 10 * model.joints]
        free = np.hstack([model.mapping[:, model.standard_slice(kind)] for kind in held])
        information, moment = consistent.sums.weighted(consistent.weights)
        rest = moment - information @ rigid @ self.links.ravel()
        found, _ = scipy.optimize.nnls(*rows_of(free.T @ information @ free, free.T @ rest))
        zeros = vars(Drives.none(model.joints))
        return Drives(**zeros | dict(zip(held, found.reshape(-1, model.joints))))

    @cached_property
    def unmodelled(self) -> Unmodelled:
        """Unmodelled torques, from the residuals of the chosen method."""
        return find_unmodelled(self.model, self.chosen, measurements_of(self.training))

    @property
    def modelled(self) -> list[str]:
        """Sentences on the effects that the model has, and what each buys."""
        return [
            f"{self.quality.joint(j)}: the model has {EFFECT_KINDS[kind].words}, which leaves {error:.0%} of "
            "the squared error on data held out in turn"
            for j, kind, error in self.effects
        ]

    @property
    def left_over(self) -> list[str]:
        """Sentences on the unmodelled torques of each joint."""
        names = [self.quality.joint(j) for j in range(self.model.joints)]
        return self.unmodelled.sentences(names, self.quality.torque_deviation)


def measurements_of(recordings: list[CheckedRecording]) -> list[Measurements]:
    """Measurements of recordings, one for each segment without gaps."""
    return [Measurements(*segment[1:]) for recording in recordings for segment in recording.segments]
