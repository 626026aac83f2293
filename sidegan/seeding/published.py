"""Seed sets that others optimised, in the form in which the authors of the paper published theirs.

Source: github.com/Instassa/SIDE-GAN-Pytorch, the accompanying code of Jegorova et al. 2020.

An image (2, H + 1, J) holds the coefficients a and b, times ``SCALE``. Its first H rows are the J · H
coefficients of a channel joint after joint, reshaped without regard to that, so that rows are not harmonics
and columns are not joints; its last row repeats the first.
"""

import hashlib
import json
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.storage import reading
from sidegan.errors import ConfigError
from sidegan.motion.trajectory import Trajectory

SCALE = 4.9  # from coefficients [rad/s] to images; the optimiser's box of ±0.2 becomes ±0.98
REPOSITORY = "https://github.com/Instassa/SIDE-GAN-Pytorch"
_MASTER, _SINGLE, _LIBRARY = "train_trajectory_master*.npy", "train_trajectory_*.npy", "*.json"
_FEATURES = "diag_master*.npy"
WEIGHTS = {"predictor": "model_0_SR.pth", "converter": "model_0_50k_epochs.pth"}
_SAME = 1e-3  # [rad/s] between the base pulsation of a file and that of the trajectories


@dataclass(frozen=True)
class Layout:
    """Images of the trajectories of an arm, and back."""

    joints: int
    harmonics: int

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of an image, (2, H + 1, J)."""
        return 2, self.harmonics + 1, self.joints

    def image(self, c: Array) -> Array:
        """Images (B, 2, H + 1, J) float32 of coefficients [rad/s], (B, J, H, 2)."""
        rows = SCALE * c.transpose(0, 3, 1, 2).reshape(len(c), 2, self.harmonics, self.joints)
        return np.concatenate([rows, rows[:, :, :1]], 2).astype(np.float32)

    def coefficients(self, image: Array) -> Array:
        """Coefficients [rad/s], (B, J, H, 2), of images (B, 2, H + 1, J), whose last row is ignored."""
        rows = image[:, :, :-1].reshape(len(image), 2, self.joints, self.harmonics)
        return rows.transpose(0, 2, 3, 1) / SCALE


@dataclass(frozen=True)
class PublishedSeeds:
    """The seeds in the files of a folder, or of one below it.

    They are all in one array, ``train_trajectory_master_.npy`` of shape (N, 2, H + 1, J), or each in an array
    ``train_trajectory_….npy`` of shape (H + 1, J, 2), or each in a JSON file with ``coefficient_a`` and
    ``coefficient_b`` [rad/s], joint after joint; the first of these that is there is read.
    """

    folder: Path

    def _found(self, pattern: str) -> list[Path]:
        return sorted(self.folder.expanduser().rglob(pattern))

    @cached_property
    def files(self) -> list[Path]:
        """The files, in order.

        Raises:
            ConfigError: when there are none.
        """
        for pattern in (_MASTER, _SINGLE, _LIBRARY):
            if found := self._found(pattern):
                return found
        raise ConfigError(
            f"seeds.folder={self.folder}: no seeds there, expected {_MASTER}, {_SINGLE}, or JSON files with "
            f"coefficient_a and coefficient_b; the paper's: git clone {REPOSITORY}"
        )

    @property
    def digest(self) -> str:
        """SHA-256 of the files' contents."""
        return hashlib.sha256(b"".join(path.read_bytes() for path in self.files)).hexdigest()

    def read(self, trajectory: Trajectory) -> Array:
        """Coefficients [rad/s], (N, J, H, 2), in the order of the files.

        Raises:
            ConfigError: when a file is not of the layout, or its seeds are not of these trajectories.
        """
        layout = Layout(trajectory.joints, trajectory.harmonics)
        return np.concatenate([_read(path, layout, 2 * math.pi / trajectory.period) for path in self.files])

    def features(self) -> Array | None:
        """The authors' 35 features of every seed of the array, diag YᵀY of theirs, (N, 35); None without."""
        found = self._found(_FEATURES)
        return np.load(found[0]).astype(float) if found else None

    def weights(self, name: str) -> Path:
        """File of the authors' weights of ``predictor`` or ``converter``.

        Raises:
            ConfigError: when they are not there.
        """
        found = self._found(WEIGHTS[name])
        if not found:
            raise ConfigError(
                f"seeds.folder={self.folder}: no {WEIGHTS[name]} there, the published {name}; "
                "surrogates.shipped=false trains one"
            )
        return found[0]


def _read(path: Path, layout: Layout, pulsation: float) -> Array:
    if path.suffix == ".json":
        with reading(path, "coefficient_a and coefficient_b", ConfigError):
            return _from_json(path, layout, pulsation)
    with reading(path, "NumPy", ConfigError):
        images = np.load(path, allow_pickle=False)
    images = images if images.ndim == 4 else np.moveaxis(images[None], -1, 1)
    if images.shape[1:] != layout.shape:
        raise ConfigError(
            f"{path} has images of shape {images.shape[1:]}, expected {layout.shape} for trajectories of "
            f"{layout.joints} joints and {layout.harmonics} harmonics"
        )
    x = images.astype(float)
    if not np.array_equal(x[:, :, 0], x[:, :, -1]):
        raise ConfigError(
            f"{path} is not of the published layout: the last row of an image repeats its first"
        )
    return layout.coefficients(x)


def _from_json(path: Path, layout: Layout, pulsation: float) -> Array:
    content = json.loads(path.read_text())
    frequency = float(content.get("frequency", pulsation))
    if abs(frequency - pulsation) > _SAME:
        raise ConfigError(
            f"{path} has the base pulsation {frequency:g} rad/s, these trajectories {pulsation:g}: "
            f"set trajectory.period={2 * math.pi / frequency:.6g}"
        )
    channels = [np.array(content[f"coefficient_{name}"], float) for name in "ab"]
    return np.stack(channels, -1).reshape(1, layout.joints, layout.harmonics, 2)
