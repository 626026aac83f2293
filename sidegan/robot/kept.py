"""Fitted shapes in a file: with it, what was made for an arm can be checked where its meshes are not."""

import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pinocchio as pin

from sidegan.base.storage import replacing
from sidegan.errors import RobotError
from sidegan.robot.arm import Arm
from sidegan.robot.description import Description, read_description
from sidegan.robot.enclosing import Points
from sidegan.robot.locking import from_rpy
from sidegan.robot.model import build
from sidegan.robot.shapes import Shape

_NAMES = ("link", "owner", "digest", "ends", "radius", "corners", "start", "rounding", "placed", "places")
_SAME = 1e-9  # [m, or of a rotation's elements] by which places of meshes may differ


def save_shapes(arm: Arm, path: Path) -> bool:
    """Write the shapes that were fitted to an arm's meshes; whether there are any.

    Raises:
        StorageError: when the file cannot be written.
    """
    capsules, pieces = arm.capsules, arm.capsules.pieces
    if pieces is None or not pieces.fitted.any():
        return False
    rows = pieces.fitted.nonzero()[:, 0].tolist()
    description = read_description(arm.urdf, arm.setup)
    places = mesh_places(build(description), description)
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
        np.array([owner for owner, rows in places.items() for _ in rows]),
        np.concatenate([*places.values()]),
    )
    with replacing(path) as draft, draft.open("wb") as stream:
        np.savez(stream, *arrays)
    return True


def mesh_places(model: pin.Model, description: Description) -> dict[str, Points]:
    """Joint, rotation and place [m], (M, 13), of the collision meshes of each link, there or not."""
    places = {}
    for owner, origins in description.origins.items():
        frame = model.frames[model.getFrameId(owner, pin.FrameType.BODY)]
        made = [frame.placement * pin.SE3(from_rpy(rpy), np.array(xyz)) for xyz, rpy in origins]
        places[owner] = np.array([[frame.parentJoint, *x.rotation.ravel(), *x.translation] for x in made])
    return places


def read_shapes(path: Path, now: Mapping[str, Points]) -> list[Shape]:
    """The shapes in a file, one for each link that has some.

    Args:
        path: the file.
        now: where the meshes are in the description that asks for them.

    Raises:
        RobotError: when there is no such file, it is another one, or the meshes were elsewhere on a link.
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
        then = of["places"][of["placed"] == owner]
        if owner in now and (len(then) != len(now[owner]) or np.abs(then - now[owner]).max() > _SAME):
            raise RobotError(
                f"robot.shapes={path} does not fit: the collision meshes of link {owner!r} are elsewhere in "
                "this description; make it again where the meshes are, or leave it out: robot.shapes=null"
            )
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
