"""A robot's description as URDF, whatever it was written as."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from sidegan.robot import xml


@dataclass(frozen=True)
class Source:
    """A description as URDF."""

    text: bytes  # of the URDF
    root: ET.Element
    poses: dict[str, dict[str, float]] = field(default_factory=dict)  # named joint positions [rad or m]
    told: tuple[str, ...] = ()  # what could not be carried over
    gravity: tuple[float, float, float] | None = None  # in the first link's frame [m/s²], where it is stated


def read_source(path: Path, args: Mapping[str, str] | None = None) -> Source:
    """A description from a URDF, xacro or MJCF file.

    Args:
        path: the file; one that ends in .xacro is expanded first.
        args: of a xacro file.

    Raises:
        RobotError: when the file cannot be read, or is none of these.
    """
    if path.suffix == ".xacro":
        from sidegan.robot.expand import expand

        text = expand(path, args or {})
        return Source(text, xml.parse_text(text, path))
    root = xml.parse(path, ("robot", "mujoco"))
    if root.tag == "mujoco":
        from sidegan.robot.mjcf import read_mjcf

        return read_mjcf(path)
    return Source(path.read_bytes(), root)
