"""The model of an arm with what it carries: the arm's parameters are of all runs, the load's of some."""

import torch
from torch import Tensor

from sidegan.identification.gather import Gathered, gather
from sidegan.identification.measurements import Measurements
from sidegan.identification.model import TorqueModel
from sidegan.motion.dynamics import LINK_PARAMETERS

LOAD = len(LINK_PARAMETERS)  # parameters of what is fixed to the last link, the last ones of the model


class Loaded:
    """A model of an arm with columns behind it for what is fixed to its last link, zero where nothing is.

    Args:
        model: of the arm.
        carried: whether the load is.
        known: parameters of a known load, (10,), whose torque is a single column then; None: ten columns.
    """

    kinds = ("load",)  # a model with more than rigid base parameters

    def __init__(self, model: TorqueModel, carried: bool, known: Tensor | None = None) -> None:
        self.arm_model, self._carried, self._known = model, carried, known
        self.joints, self.arm = model.joints, model.arm
        more = [f"load {name}" for name in LINK_PARAMETERS] if known is None else ["load"]
        self.names = [*model.names, *more]
        self.count = len(self.names)

    def regressor(self, q: Tensor, dq: Tensor, ddq: Tensor, sign: Tensor | None = None) -> Tensor:
        """Regressor, (S, J, P + 10) or (S, J, P + 1), of states (S, J)."""
        load = self.arm_model.body.regressor(q, dq, ddq)[..., -LOAD:]
        if self._known is not None:
            load = (load @ self._known.to(q))[..., None]
        return torch.cat([self.arm_model.regressor(q, dq, ddq, sign), load * float(self._carried)], 2)


def gathered(
    model: TorqueModel, unloaded: list[Measurements], loaded: list[Measurements], known: Tensor | None = None
) -> list[Gathered]:
    """Sums over runs without and with the load, of one set of parameters.

    Raises:
        ShapeError: when there are no samples, or they do not fit the model.
    """
    runs = ((unloaded, False), (loaded, True))
    return [gather(Loaded(model, carried, known), samples) for samples, carried in runs]  # type: ignore[arg-type]
