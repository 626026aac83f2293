"""SIDE-GAN: networks, surrogates, variants and the one training loop; the only door to Lightning."""

from sidegan.gan.generator import TrajectoryGenerator
from sidegan.gan.variants import Variant

__all__ = ["TrajectoryGenerator", "Variant"]
