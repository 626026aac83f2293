"""Loading of an arm from a name or a path."""

import logging
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from sidegan.base.names import listed
from sidegan.base.settings_text import suggest_touching, suggestion
from sidegan.base.storage import path_of
from sidegan.base.typed import settings_of
from sidegan.errors import RobotError
from sidegan.robot.arm import Arm, digest_of, length_of
from sidegan.robot.collision import collision_shapes
from sidegan.robot.description import Description, read_description
from sidegan.robot.model import kinematics_and_inertias, pinocchio_model
from sidegan.robot.setup import PLAIN, Setup
from sidegan.robot.shapes import VERSION, capsules_of
from sidegan.robot.thresholds import LONGEST_ARM

_MODELS = Path(__file__).parent / "models"
_log = logging.getLogger(__name__)


def built_in_robots() -> list[str]:
    """Names that `load_robot` knows without a path, sorted."""
    return sorted(file.stem for file in _MODELS.glob("*.urdf"))


def is_built_in(arm: Arm) -> bool:
    """Whether an arm is a built-in one, and not mounted otherwise, not even turned about the vertical."""
    return arm.urdf.parent == _MODELS and not any(arm.mount)


def load_robot(
    name_or_path: str | Path,
    setup: Setup | Mapping[str, Any] = PLAIN,
    home: Sequence[float] | None = None,
    planning: bool = True,
) -> Arm:
    """An arm (J joints, float64, SI units) from a built-in name or a description.

    Links behind fixed or locked joints become part of the link that carries them. The tip is the origin of
    the link that the setup names, or, if that is the last joint's own, of the link farthest from that joint.
    Collision shapes become capsules that enclose them. Missing mesh files are left out, with a warning.

    Args:
        name_or_path: a built-in name ("kuka_lwr4", "planar2"), a name from robot_descriptions if that is
            installed, or the path of a URDF, xacro or MJCF file.
        setup: which part of the description is the arm, and limits that override the description's: a
            ``Setup``, or its fields.
        home: home position [rad or m], (J,), around which continuous joints may turn by half a turn; None:
            that of the description, or zeros.
        planning: whether motions are to be planned. Otherwise meshes are left out, and missing limits on
            position and velocity get defaults.

    Raises:
        RobotError: when there is no such robot, the file is not a description, or the arm is not a serial
            chain of revolute and prismatic joints with limits on position and velocity.
        ConfigError: when a setting is unknown or out of range; names it.
        ShapeError: when home is not one finite position per joint.
    """
    path_of(name_or_path, "robot")
    setup = settings_of(Setup, setup)
    path, args = _find(name_or_path)
    if args:
        setup = replace(setup, args={**args, **(setup.args or {})})
    description = read_description(path, setup, home, planning)
    model = pinocchio_model(description)
    chain = kinematics_and_inertias(model, setup.tip)
    length = float(np.linalg.norm([*chain["translation"][1:], chain["tip"]], axis=1).sum())
    if length > LONGEST_ARM:
        raise RobotError(f"{path}: the links are {length:.4g} m long together: are these millimetres?")
    numbers = chain | description.limits
    drives = description.drives
    stated = {} if drives is None else vars(drives)
    shapes, refused = collision_shapes(model, description, length_of(numbers))
    capsules = capsules_of(shapes)
    # what the validity of trajectories depends on beyond numbers and capsules
    stamped = sorted({shape.digest for shape in shapes if shape.digest})
    if setup.may_touch:
        stamped += sorted({" ".join(sorted(pair)) for *pair, _ in description.may_touch})
    stamped += [] if capsules.exact.all() else [f"shapes {VERSION}"]
    _warn(description, refused, setup)
    return Arm(
        name=description.name,
        digest=digest_of(numbers | stated, capsules, stamped),
        joint_names=tuple(description.moved),
        link_names=tuple(description.moved.values()),
        capsules=capsules,
        urdf=path,
        setup=replace(setup, limits=setup.limits.of_joints(description.moved)),
        notes=tuple(description.notes),
        parents=description.parents,
        may_touch=description.may_touch,
        mount=description.mount,
        planes=description.planes,
        drives=drives,
        home=description.home,
        **numbers,
    )


def _warn(description: Description, refused: Mapping[tuple[str, str], float], setup: Setup) -> None:
    """Warn about forces left out, links that lack a shape, and pairs whose shapes are too coarse."""
    if description.passive:
        left_out = "; ".join(description.passive)
        _log.warning("%s: torques and limits do not include %s", description.path, left_out)
    if description.missing:
        _log.warning(
            "%s: mesh files are missing or empty; collisions of these links may go unnoticed: %s "
            "(not found: %s; packages are searched for above the description and on ROS_PACKAGE_PATH and "
            "AMENT_PREFIX_PATH)",
            description.path,
            ", ".join(description.missing),
            listed([file for files in description.missing.values() for file in files], 4),
        )
    if refused:
        _log.warning(
            "%s: collision shapes are too coarse for links that are close by design, and rule out this share "
            "of the free configurations: %s; if these cannot touch, leave them unchecked by %s",
            description.path,
            listed([f"{' – '.join(pair)} ({share:.0%})" for pair, share in refused.items()], 4),
            suggest_touching(refused, setup.may_touch),
        )


def _find(name_or_path: str | Path) -> tuple[Path, dict[str, str]]:
    """The description's file, and arguments if it is a xacro file."""
    if str(name_or_path) in built_in_robots():
        return _MODELS / f"{name_or_path}.urdf", {}
    try:
        path = Path(name_or_path).expanduser()
        if path.is_file():
            return path.resolve(), {}
        if path.is_dir():
            raise RobotError(f"{path} is a folder, expected a URDF, xacro or MJCF file")
    except (OSError, RuntimeError) as error:  # a forbidden folder, an unknown ~user
        raise RobotError(f"cannot look for {name_or_path}: {error}") from error
    if isinstance(name_or_path, str) and not path.suffix and path.name == name_or_path:
        if (found := _by_name(name_or_path)) is not None:
            return found
        more = "" if find_spec("robot_descriptions") else "; pip install 'sidegan[named]' adds many more"
        names = ", ".join(built_in_robots())
        raise RobotError(
            f"there is no robot named {name_or_path!r}, expected {names} or the path of a description{more}"
        )
    raise RobotError(f"there is no file {path}")


def _by_name(name: str) -> tuple[Path, dict[str, str]] | None:
    """A description's file in robot_descriptions, and arguments if it is a xacro file.

    Names are like "panda" or "panda_description", or "panda_mj_description" for MJCF. The first use downloads
    the description. None if robot_descriptions is not installed or does not have the name.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or find_spec("robot_descriptions") is None:
        return None
    stem = "robot_descriptions." + name.removesuffix("_description")
    module = next((stem + end for end in ("_description", "_mj_description") if find_spec(stem + end)), None)
    if module is None:
        return None
    try:
        found = import_module(module)
    except Exception as error:  # git, the network, the disk
        reason = " ".join(str(error).split())
        raise RobotError(
            f"robot_descriptions cannot fetch {module.partition('.')[2]}: {reason}; to use your own file: "
            f"{suggestion('robot.name', 'arm.urdf')}"
        ) from error
    paths = [getattr(found, kind, None) for kind in ("URDF_PATH", "XACRO_PATH", "MJCF_PATH")]
    path = next(filter(None, paths), None)
    return None if path is None else (Path(path), dict(getattr(found, "XACRO_ARGS", {})))
