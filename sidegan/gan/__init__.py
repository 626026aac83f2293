"""SIDE-GAN: networks, surrogates, variants and the one adversarial loop; the only door to Lightning."""

from sidegan.gan.generator import TrajectoryGenerator
from sidegan.gan.variants import Variant, Weights

__all__ = ["TrajectoryGenerator", "Variant", "Weights"]
