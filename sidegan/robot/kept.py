"""Fitted shapes in a file: with it, what was made for an arm can be checked where its meshes are not."""

import zipfile
from pathlib import Path

import numpy as np

from sidegan.base.storage import replacing
from sidegan.errors import RobotError
from sidegan.robot.arm import Arm
from sidegan.robot.shapes import Shape

_NAMES = ("link", "owner", "digest", "ends", "radius", "corners", "start", "rounding")


def save_shapes(arm: Arm, path: Path) -> bool:
    """Write the shapes that were fitted to an arm's meshes; whether there are any.

    Raises:
        StorageError: when the file cannot be written.
    """
    capsules, pieces = arm.capsules, arm.capsules.pieces
    if pieces is None or not pieces.fitted.any():
        return False
    rows = pieces.fitted.nonzero()[:, 0].tolist()
    corners = [pieces.corners[pieces.start[k] : pieces.start[k + 1]].numpy() for k in rows]
    arrays = (
        capsules.link[rows].numpy(),
        np.array([capsules.owners[k] for k in rows]),
        np.array([pieces.digests[k] for k in rows]),
        np.stack([capsules.a[rows].numpy(), capsules.b[rows].numpy()], 1),
        capsules.radius[rows].numpy(),
        np.concatenate(corners),
        np.cumsum([0, *map(len, corners)]),
        pieces.radius[rows].numpy(),
    )
    with replacing(path) as draft, draft.open("wb") as stream:
        np.savez(stream, *arrays)
    return True


def read_shapes(path: Path) -> list[Shape]:
    """The shapes in a file, one for each link that has some.

    Raises:
        RobotError: when there is no such file, or it is another one.
    """
    try:
        with np.load(path, allow_pickle=False) as held:
            of = dict(zip(_NAMES, (held[f"arr_{k}"] for k in range(len(_NAMES)))))
    except FileNotFoundError as error:
        raise RobotError(f"there is no file robot.shapes={path}") from error
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise RobotError(f"robot.shapes={path} holds no shapes: {error}") from error
    shapes = []
    for owner in dict.fromkeys(of["owner"].tolist()):
        rows = np.flatnonzero(of["owner"] == owner)
        shapes.append(
            Shape(
                link=int(of["link"][rows[0]]),
                owner=owner,
                name=owner,
                segments=tuple((of["ends"][k], float(of["radius"][k])) for k in rows),
                corners=tuple(of["corners"][of["start"][k] : of["start"][k + 1]] for k in rows),
                rounding=tuple(of["rounding"][rows].tolist()),
                exact=False,
                digest=str(of["digest"][rows[0]]),
            )
        )
    return shapes
