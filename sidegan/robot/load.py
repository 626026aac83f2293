"""From a name or a path to an arm."""

import logging
from pathlib import Path

import torch

from sidegan.errors import RobotError
from sidegan.robot.arm import Arm, digest_of
from sidegan.robot.description import read_description

_MODELS = Path(__file__).parent / "models"
_log = logging.getLogger(__name__)


def built_in_robots() -> list[str]:
    """Names that `load_robot` knows without a path, sorted."""
    return sorted(file.stem for file in _MODELS.glob("*.urdf"))


def load_robot(name_or_path: str | Path) -> Arm:
    """An arm (J joints, float64, SI units) from a built-in name or a URDF file.

    Links behind fixed joints become part of the link that carries them. The tip is the frame of the link
    furthest from the last joint among those it carries. Spheres, cylinders, capsules (a cylinder that
    `<collision_checking>` marks as one), boxes and meshes become capsules that enclose them; a link whose
    mesh files are absent is left without that shape, and a warning says so.

    Args:
        name_or_path: a built-in name, such as "kuka_lwr4" or "planar2", or the path of a URDF file. The
            effort limit of a joint may be absent or zero: it is then infinite. Everything else that
            motion planning needs must be there.

    Raises:
        RobotError: when there is no such robot, the file is not a URDF, or the arm is not a serial chain of
            revolute and prismatic joints with limits on position and velocity.
    """
    path = _find(name_or_path)
    description = read_description(path)

    from sidegan.robot import model as pin_model  # Pinocchio takes a second to import

    model = pin_model.build(description)
    chain = pin_model.kinematics_and_inertias(model)
    names = tuple(model.names)[1:]
    limits = torch.tensor([description.limits[name] for name in names], dtype=torch.float64).T.contiguous()
    numbers = {
        **chain,
        "position_lower": limits[0],
        "position_upper": limits[1],
        "velocity_limit": limits[2],
        "torque_limit": limits[3],
    }
    capsules = pin_model.enclosing_capsules(model, description)
    if description.shapeless:
        bare = ", ".join(description.shapeless)
        _log.warning("%s: mesh files are missing; collisions of these links may go unnoticed: %s", path, bare)
    return Arm(
        name=description.name,
        digest=digest_of(numbers, capsules),
        joint_names=names,
        link_names=tuple(description.moved[name] for name in names),
        capsules=capsules,
        urdf=path,
        **numbers,
    )


def _find(name_or_path: str | Path) -> Path:
    """The URDF file that is meant."""
    if str(name_or_path) in built_in_robots():
        return _MODELS / f"{name_or_path}.urdf"
    try:
        path = Path(name_or_path).expanduser()
        if path.is_file():
            return path.resolve()
        if path.is_dir():
            raise RobotError(f"{path} is a folder, expected a URDF file")
    except (OSError, RuntimeError) as error:  # a forbidden folder, an unknown ~user
        raise RobotError(f"cannot look for {name_or_path}: {error}") from error
    if isinstance(name_or_path, str) and not path.suffix and path.name == name_or_path:
        names = ", ".join(built_in_robots())
        raise RobotError(f"there is no robot named {name_or_path!r}, expected {names} or a URDF file's path")
    raise RobotError(f"there is no URDF file {path}")
