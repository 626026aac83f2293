"""Covers of meshes: capsules and hulls, made once and kept in a cache of the user's."""

import hashlib
import logging
import os
import zipfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sidegan.base.storage import replacing
from sidegan.errors import StorageError
from sidegan.robot.capsule_fit import Points, Segment
from sidegan.robot.covering import cover
from sidegan.robot.hull import thinned

VERSION = 1  # raise it when covers of the same mesh become others
SEVERAL = 3  # the same of links with several meshes
FURTHER = 2  # the same of links that are cut further
VARIABLE = "SIDEGAN_CACHE"  # environment variable that names the folder of the cache

_FINE = 3e-4  # [m] by which hulls may be larger than they need be, for fewer corners
_FINER = 3e-5  # the same of those that are cut further: some links pass within a fraction of a millimetre
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Cover:
    """Capsules and convex pieces that hold the meshes of a link, in the frame of the first mesh."""

    digest: str  # of the meshes, of how many pieces there may be, and of how they are found
    segments: tuple[Segment, ...]  # end points [m], (2, 3), and radius [m] of the capsules
    corners: tuple[Points, ...]  # of the hull in each capsule [m], (V, 3)
    rounding: tuple[float, ...]  # radius of the ball that is added to each hull [m]


def cover_of(
    meshes: str, count: int, triangles: Callable[[], list[Points]], pieces: int, further: int = 0
) -> Cover:
    """Cover of the meshes of a link, from the cache where it is there.

    Args:
        meshes: digest of the meshes.
        count: their number.
        triangles: gives the corners of the triangles of each [m], (N, 3, 3).
        pieces: their number at most.
        further: into how many parts these are cut then, at most; the digest does not tell.
    """
    digest = hashlib.sha256(f"{meshes} {pieces} {VERSION if count == 1 else SEVERAL}".encode()).hexdigest()
    name = hashlib.sha256(f"{digest} {further} {FURTHER}".encode()).hexdigest() if further else digest
    file = cache_folder() / "shapes" / f"{name}.npz"
    found = read(file, digest)
    if found is None:
        found = make(digest, triangles(), pieces, further)
        with suppress(StorageError):  # a folder that cannot be written: the work is done again next time
            write(file, found)
    return found


def cache_folder() -> Path:
    """Folder of what can be made again: that of ``SIDEGAN_CACHE``, or sidegan in the user's cache."""
    if os.environ.get(VARIABLE):
        return Path(os.environ[VARIABLE])
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "sidegan"


def make(digest: str, meshes: list[Points], pieces: int, further: int = 0) -> Cover:
    """A cover of the triangles of some meshes, (N, 3, 3) each."""
    _log.info("fitting collision shapes to %d triangles", sum(map(len, meshes)))
    parts = cover(meshes, pieces, further)
    hulls = [thinned(part.corners, _FINER if further else _FINE) for part in parts]
    return Cover(
        digest,
        tuple(part.capsule for part in parts),
        tuple(corners for corners, _ in hulls),
        tuple(rounding for _, rounding in hulls),
    )


def write(file: Path, made: Cover) -> None:
    """Keep a cover in a file."""
    ends = np.array([ends for ends, _ in made.segments])
    radii = np.array([radius for _, radius in made.segments])
    counts = np.array([len(corners) for corners in made.corners])
    corners, rounding = np.concatenate(made.corners), np.array(made.rounding)
    with replacing(file) as draft, draft.open("wb") as stream:
        np.savez(stream, ends=ends, radii=radii, counts=counts, corners=corners, rounding=rounding)


def read(file: Path, digest: str) -> Cover | None:
    """The cover in a file; None where there is none, or none that can be read."""
    try:
        with np.load(file, allow_pickle=False) as held:
            ends, radii, counts, corners, rounding = (
                held[name] for name in ("ends", "radii", "counts", "corners", "rounding")
            )
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    segments = tuple((one, float(radius)) for one, radius in zip(ends, radii))
    hulls = tuple(np.split(corners, np.cumsum(counts)[:-1]))
    return Cover(digest, segments, hulls, tuple(rounding.tolist()))
