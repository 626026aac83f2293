"""Seed sets in the format of the paper's authors.

Source: github.com/Instassa/SIDE-GAN-Pytorch, the accompanying code of Jegorova et al. 2020.

An image (2, H + 1, J) holds the coefficients a and b, times ``SCALE``. Its first H rows are the J · H
coefficients of a channel in order of joints, but reshaped to (H, J), so that rows are not harmonics and
columns are not joints; its last row repeats the first.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.storage import reading
from sidegan.errors import ConfigError
from sidegan.motion.trajectory import Trajectory

SCALE = 4.9  # from coefficients [rad/s] to images: the optimiser's box of ±0.2 becomes ±0.98
REPOSITORY = "https://github.com/Instassa/SIDE-GAN-Pytorch"
_MASTER, _FEATURES = "train_trajectory_master*.npy", "diag_master*.npy"
WEIGHTS = {"predictor": "model_0_SR.pth", "converter": "model_0_50k_epochs.pth"}


@dataclass(frozen=True)
class Layout:
    """Conversion between an arm's trajectories and images."""

    joints: int
    harmonics: int

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of an image, (2, H + 1, J)."""
        return 2, self.harmonics + 1, self.joints

    def image(self, c: Any) -> Any:
        """Images (B, 2, H + 1, J), float32, of coefficients [rad/s], (B, J, H, 2)."""
        rows = SCALE * c.transpose(0, 3, 1, 2).reshape(len(c), 2, self.harmonics, self.joints)
        return np.concatenate([rows, rows[:, :, :1]], 2).astype(np.float32)

    def coefficients(self, image: Any) -> Any:
        """Coefficients [rad/s], (B, J, H, 2), of images (B, 2, H + 1, J), an array or a tensor.

        The last row is ignored.
        """
        rows = image[:, :, :-1].reshape(len(image), 2, self.joints, self.harmonics)
        return rows.swapaxes(1, 2).swapaxes(2, 3) / SCALE


@dataclass(frozen=True)
class PublishedSeeds:
    """Seeds in an array ``train_trajectory_master_.npy``, (N, 2, H + 1, J), in a folder or its subfolders."""

    folder: Path

    def _found(self, pattern: str, refusal: str) -> Path:
        """The first file of this name; a ConfigError if there is none."""
        if found := min(self.folder.expanduser().rglob(pattern), default=None):
            return found
        raise ConfigError(f"seeds.folder={self.folder} has no {refusal}")

    @cached_property
    def file(self) -> Path:
        """The array's file; ConfigError if there is none."""
        return self._found(_MASTER, f"seeds, expected {_MASTER}; for the paper's: git clone {REPOSITORY}")

    def read(self, trajectory: Trajectory) -> Array:
        """Coefficients [rad/s], (N, J, H, 2); ConfigError if the file does not have this layout."""
        path = self.file
        layout = Layout(trajectory.joints, trajectory.harmonics)
        with reading(path, "NumPy", ConfigError):
            images = np.load(path, allow_pickle=False).astype(float)
        if images.shape[1:] != layout.shape:
            raise ConfigError(
                f"{path} has images of shape {images.shape[1:]}, expected {layout.shape} for trajectories of "
                f"{layout.joints} joints and {layout.harmonics} harmonics"
            )
        if not np.array_equal(images[:, :, 0], images[:, :, -1]):
            raise ConfigError(
                f"{path} is not in the published layout: the last row of an image must repeat its first"
            )
        return layout.coefficients(images)

    def features(self) -> Array | None:
        """The authors' 35 features of each seed, their diag YᵀY, (N, 35); None if there are none."""
        found = min(self.folder.expanduser().rglob(_FEATURES), default=None)
        if found is None:
            return None
        with reading(found, "NumPy", ConfigError):
            return np.load(found).astype(float)

    def weights(self, name: str) -> Path:
        """File of the authors' weights of ``predictor`` or ``converter``; ConfigError if it is missing."""
        instead = f"the published {name}; surrogates.shipped=false trains one instead"
        return self._found(WEIGHTS[name], f"{WEIGHTS[name]}, {instead}")
