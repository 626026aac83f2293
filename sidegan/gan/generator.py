"""The generator of trajectories: network, scaling and limits, saved in one file."""

from collections.abc import Callable
from dataclasses import asdict, fields
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from sidegan.base.arrays import Array
from sidegan.base.random import seed_of
from sidegan.base.storage import reading
from sidegan.errors import ArtifactError, ShapeError
from sidegan.gan.networks import Correction, DenseGenerator, FromNoise
from sidegan.gan.published import ConvolutionalGenerator, PublishedScaling
from sidegan.gan.scaling import CoefficientBox, LimitLayer, Scaling
from sidegan.gan.tensors import numpy_array, read_tensors, write_tensors
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm, MotionLimits

_FORMAT = 9
_LIMITS = [field.name for field in fields(MotionLimits) if field.name not in ("name", "digest")]


class TrajectoryGenerator(nn.Module):
    """A generator network with its scaling, the trajectories' family, and the limits of its arm.

    Args:
        network: noise → images.
        scaling: images → coefficients, before the box if there is one.
        trajectory: the family of trajectories.
        arm: the arm that the trajectories are for, or its limits alone.
        limited: whether a last layer enforces the limits on motion.
        box: bound on the absolute coefficients [rad/s]; None: no bound.
        corrections: number of networks that correct images, given their trajectories, one after the other.
    """

    def __init__(
        self,
        network: FromNoise,
        scaling: Scaling | PublishedScaling,
        trajectory: Trajectory,
        arm: MotionLimits,
        *,
        limited: bool = False,
        box: float | None = None,
        corrections: int = 0,
    ) -> None:
        super().__init__()
        self.network, self.scaling = network, scaling
        self.box = nn.Identity() if box is None else CoefficientBox(box)
        self.limits = LimitLayer(arm, trajectory) if limited else nn.Identity()
        self.options = {"limited": limited, "box": box, "corrections": corrections}
        width = network.settings["width"]
        self.corrections = nn.ModuleList(Correction(arm, trajectory, width) for _ in range(corrections))
        self.trajectory, self.arm = trajectory, arm
        self.float()

    def bounded(self, free: Tensor) -> Tensor:
        """Coefficients [rad/s], (B, J, H, 2), within the box and the limits; ``free`` itself without both."""
        return self.limits(self.box(free))

    def images(self, count: int, stream: torch.Generator | None = None) -> Tensor:
        """New images, (count, 2, …), corrected by networks that see the motions before the limits layer."""
        images = self.network.sample(count, stream)
        for correction in self.corrections:
            images = images + correction(images, self.box(self.scaling.coefficients(images)))
        return images

    @torch.no_grad()
    def sample(self, count: int, seed: int | torch.Generator = 0) -> Array:
        """New coefficients [rad/s], (count, J, H, 2) float64, from a seed or the next numbers of a stream.

        Raises:
            ConfigError: when the seed is not a whole number ≥ 0.
            ShapeError: when count is not a positive whole number.
        """
        if not isinstance(count, Integral) or isinstance(count, bool) or count < 1:
            raise ShapeError(f"cannot sample {count!r} trajectories, expected a positive whole number")
        if isinstance(seed, torch.Generator):
            stream = seed
        else:
            stream = torch.Generator().manual_seed(seed_of(seed) % 2**64)  # torch's seeds have 64 bits
        return numpy_array(self.bounded(self.scaling.coefficients(self.images(count, stream))))

    def stream(self, seed: int) -> Callable[[int], Array]:
        """Function that draws new coefficients [rad/s], (count, J, H, 2), different at every call."""
        noise = torch.Generator().manual_seed(seed)
        return lambda count: self.sample(count, noise)

    def predict(self, wanted: Any) -> Array:
        """New coefficients [rad/s], (count, J, H, 2), as MLflow calls it.

        ``wanted``: a dictionary, or a table with one row, of ``count`` and ``seed``, which is 0 if missing.

        Raises:
            ConfigError, ShapeError: of ``sample``, and when there is no count, or more than one row.
        """
        count, seed = np.ravel(wanted.get("count", ())), np.ravel(wanted.get("seed", 0))
        if count.size != 1 or seed.size != 1:
            raise ShapeError(f"there are {count.size} values of count and {seed.size} of seed, expected one")
        return self.sample(count.item(), seed.item())

    def save(self, path: Path) -> None:
        """Write a file of tensors and plain values."""
        limits = {name: getattr(self.arm, name) for name in _LIMITS}
        content = {
            "format": _FORMAT,
            "robot": self.arm.name,
            "digest": self.arm.digest,
            "limits": {name: None if x is None else torch.tensor(x) for name, x in limits.items()},
            "trajectory": asdict(self.trajectory) | {"home": list(self.trajectory.home or ())},
            "network": self.network.settings,
            **self.options,
            "published": isinstance(self.scaling, PublishedScaling),
            "weights": self.state_dict(),
        }
        write_tensors(path, content)

    @classmethod
    def load(cls, path: Path, arm: Arm | None = None) -> "TrajectoryGenerator":
        """Generator from a file that ``save`` wrote, for an arm if given; no code in the file is executed.

        Raises:
            ArtifactError: for a damaged, incomplete or foreign file, or a different arm.
        """
        content = read_tensors(path)
        if not isinstance(content, dict) or content.get("format") != _FORMAT:
            raise ArtifactError(f"{path} does not hold a trajectory generator of format {_FORMAT}")
        with reading(path, "generator"):
            if arm is not None and content["digest"] != arm.digest:
                other = arm.unlike(content["robot"], content["digest"])
                raise ArtifactError(f"{path} was trained for {other}")
            if not all(torch.isfinite(x).all() for x in content["weights"].values()):
                raise ArtifactError(f"{path} has weights that are not finite")
            family = Trajectory(**content["trajectory"])
            joints, size = family.joints, 2 * family.harmonics
            published = content["published"]
            network = (ConvolutionalGenerator if published else DenseGenerator)(**content["network"])
            unfilled = Scaling(torch.ones(joints, size), torch.ones(joints, size, size))
            scaling = PublishedScaling(joints, family.harmonics) if published else unfilled
            options = {name: content[name] for name in ("limited", "box", "corrections")}
            generator = cls(network, scaling, family, arm or _stored_limits(content), **options)
            generator.load_state_dict(content["weights"])
        return generator.eval()


def _stored_limits(content: dict[str, Any]) -> MotionLimits:
    """The limits of the arm that a generator's file was written for."""
    stored: dict[str, Tensor | None] = content["limits"]
    limits: dict[str, Any] = {name: None if x is None else numpy_array(x) for name, x in stored.items()}
    return MotionLimits(content["robot"], content["digest"], **limits)


def _load_pyfunc(path: str) -> TrajectoryGenerator:
    """The generator for ``mlflow.pyfunc.load_model``, which finds it by the file MLmodel beside it."""
    return TrajectoryGenerator.load(Path(path))
