"""The generator of trajectories: its network, scale and limits, in one file once it is trained."""

import json
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from sidegan.base.storage import read_torch, write_torch
from sidegan.errors import ArtifactError, ShapeError, SideganError
from sidegan.gan.limits import LimitLayer
from sidegan.gan.networks import Generator
from sidegan.gan.published_networks import ConvolutionalGenerator
from sidegan.gan.scaling import Scaling
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.seeds.published import Layout

_FORMAT = 5


class TrajectoryGenerator(nn.Module):
    """A generator with its scale, the trajectories' family and the robot that it was trained for.

    Args:
        network: noise → images.
        scaling: images → coefficients.
        trajectory: the family of trajectories.
        robot: name of the arm.
        digest: of the arm's numbers.
        variant: name of the variant.
        limits: last layer that keeps the limits on motion; None where there is none.
    """

    def __init__(
        self,
        network: Generator | ConvolutionalGenerator,
        scaling: Scaling | Layout,
        trajectory: Trajectory,
        robot: str,
        digest: str,
        variant: str,
        limits: LimitLayer | None = None,
    ) -> None:
        super().__init__()
        self.network, self.scaling, self.limits = network, scaling, limits
        self.trajectory, self.robot, self.digest, self.variant = trajectory, robot, digest, variant
        self.float()

    def coefficients(self, images: Tensor) -> Tensor:
        """Coefficients [rad/s], (B, J, H, 2), of images, within the limits where there is a layer of them."""
        c = self.scaling.coefficients(images)
        return c if self.limits is None else self.limits(c)

    @torch.no_grad()
    def sample(self, count: int, seed: int | torch.Generator = 0) -> Tensor:
        """New coefficients [rad/s], (count, J, H, 2) float64; the same for the same seed.

        A stream of random numbers in place of a seed goes on.
        """
        if count < 1:
            raise ShapeError(f"cannot sample {count} trajectories, expected a positive number")
        stream = seed if isinstance(seed, torch.Generator) else torch.Generator().manual_seed(seed)
        return self.coefficients(self.network.sample(count, stream)).double().cpu()

    def save(self, path: Path) -> None:
        """Write one file of tensors and plain values."""
        meta = {
            "format": _FORMAT,
            "robot": self.robot,
            "digest": self.digest,
            "variant": self.variant,
            "trajectory": self.trajectory.describe(),
            "network": self.network.settings,
            "limits": None if self.limits is None else self.limits.higher,
            "published": isinstance(self.scaling, Layout),
        }
        write_torch(path, {"meta": json.dumps(meta), "weights": self.state_dict()})

    @classmethod
    def load(cls, path: Path, arm: Arm | None = None) -> "TrajectoryGenerator":
        """Generator of a file that ``save`` wrote, of one arm or of any (None); no code in the file is run.

        Raises:
            ArtifactError: for a truncated or foreign file, or another arm.
        """
        content = read_torch(path)
        if not isinstance(content, dict):
            raise ArtifactError(f"{path} does not hold a trajectory generator")
        try:
            meta = json.loads(content["meta"])
            if meta["format"] != _FORMAT:
                raise ArtifactError(f"{path} has format {meta['format']!r}, expected {_FORMAT}")
            generator = cls._of(meta, content["weights"]).eval()
        except ArtifactError:
            raise
        except (LookupError, AttributeError, TypeError, ValueError, RuntimeError, SideganError) as error:
            raise ArtifactError(f"{path} does not hold a trajectory generator: {error}") from error
        if arm is not None and generator.digest != arm.digest:
            raise ArtifactError(
                f"{path} was trained for {generator.robot} (digest {generator.digest[:12]}), "
                f"not for {arm.name} (digest {arm.digest[:12]})"
            )
        return generator

    @classmethod
    def _of(cls, meta: dict[str, Any], weights: dict[str, Tensor]) -> "TrajectoryGenerator":
        """The generator of a file's values, after a look at its numbers.

        Raises:
            ShapeError: when they do not fit each other, hold a number that is not finite, or make one and
                the same of everything.
            RuntimeError: when the weights are of other shapes.
        """
        for name, x in weights.items():
            if not x.isfinite().all():
                raise ShapeError(f"{name} holds a number that is not finite")
        stated = [x for x in meta["network"].values() if isinstance(x, int)]
        if max(stated, default=0) > sum(x.numel() for x in weights.values()):  # before so much is asked for
            raise ShapeError(f"its weights are fewer than the sizes {meta['network']} need")
        family = Trajectory(**meta["trajectory"])
        joints, size = family.joints, 2 * family.harmonics
        network: Generator | ConvolutionalGenerator
        scaling: Scaling | Layout
        if meta["published"]:
            network, scaling = ConvolutionalGenerator(**meta["network"]), Layout(joints, family.harmonics)
        else:
            network = Generator(**meta["network"])
            scaling = Scaling(torch.ones(joints, size), torch.ones(joints, size, size))
        limits = None
        if meta["limits"] is not None:
            inverse = {name: torch.ones(joints) for name in meta["limits"]}
            limits = LimitLayer(family, torch.ones(2, joints), torch.ones(joints), inverse)
        names = meta["robot"], meta["digest"], meta["variant"]
        generator = cls(network, scaling, family, *names, limits)
        generator.load_state_dict(weights)
        if isinstance(scaling, Scaling) and not scaling.spread.abs().sum(2).all():
            raise ShapeError("spread is zero in a coefficient, so that every trajectory would have the same")
        return generator
