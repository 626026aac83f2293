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
from sidegan.robot import HIGHER, Arm
from sidegan.seeds.published import Layout

_FORMAT = 4


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
        network = self.network
        meta = {
            "format": _FORMAT,
            "robot": self.robot,
            "digest": self.digest,
            "variant": self.variant,
            "trajectory": self.trajectory.describe(),
            "network": network.settings,
            "limited": self.limits is not None,
            "published": isinstance(self.scaling, Layout),
        }
        tensors = {}
        if isinstance(self.scaling, Scaling):
            tensors = {"mean": self.scaling.mean, "spread": self.scaling.spread}
        if self.limits is not None:
            tensors |= {"room": self.limits.room, "speed": self.limits.speed}
            tensors |= {f"inverse_{name}": x for name, x in self.limits.inverse.items()}
        write_torch(path, {"meta": json.dumps(meta), "weights": network.state_dict(), **tensors})

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
            family = Trajectory(**meta["trajectory"])
            network, scaling = _stored_network(meta, content, family)
            limits = _stored_limits(content, family) if meta["limited"] else None
            names = (meta["robot"], meta["digest"], meta["variant"])
            generator = cls(network, scaling, family, *names, limits).eval()
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


def _stored_limits(content: dict[str, Any], family: Trajectory) -> LimitLayer:
    """The last layer of a generator's file."""
    inverse = {name: content[f"inverse_{name}"] for name in HIGHER if f"inverse_{name}" in content}
    return LimitLayer(family, content["room"], content["speed"], inverse)


def _stored_network(
    meta: dict[str, Any], content: dict[str, Any], family: Trajectory
) -> tuple[Generator, Scaling] | tuple[ConvolutionalGenerator, Layout]:
    """Network and scale of a generator's file, after a look at their numbers.

    Raises:
        ShapeError: when they do not fit each other or the family, hold a number that is not finite, or make
            one and the same of everything.
    """
    weights: dict[str, Tensor] = content["weights"]
    for name, x in {**weights, **{k: v for k, v in content.items() if isinstance(v, Tensor)}}.items():
        if not x.isfinite().all():
            raise ShapeError(f"{name} holds a number that is not finite")
    stated = [x for x in meta["network"].values() if isinstance(x, int)]
    if max(stated, default=0) > sum(x.numel() for x in weights.values()):  # before so much is asked for
        raise ShapeError(f"its weights are fewer than the sizes {meta['network']} need")
    if meta["published"]:
        published, layout = ConvolutionalGenerator(**meta["network"]), Layout(family.joints, family.harmonics)
        published.load_state_dict(weights)
        return published, layout
    network = Generator(**meta["network"])
    if network.shape != (2, family.joints, family.harmonics):
        raise ShapeError(f"its network makes images {network.shape} for {family.joints} joints")
    network.load_state_dict(weights)
    scaling = Scaling(content["mean"], content["spread"])
    size = 2 * family.harmonics
    if scaling.mean.shape != (family.joints, size) or scaling.spread.shape != (family.joints, size, size):
        shapes = f"mean {tuple(scaling.mean.shape)} and spread {tuple(scaling.spread.shape)}"
        raise ShapeError(
            f"{shapes}, expected ({family.joints}, {size}) and ({family.joints}, {size}, {size})"
        )
    if not scaling.spread.abs().sum(2).all():
        raise ShapeError("spread is zero in a coefficient, so that every trajectory would have the same")
    return network, scaling
