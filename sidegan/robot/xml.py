"""XML of descriptions: required elements and attributes, and finite numbers."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import SupportsFloat

from sidegan.errors import RobotError

_LARGEST = 1e18  # of any number in SI units, so that products of a few are finite


@dataclass(frozen=True)
class Source:
    """A description as URDF."""

    text: bytes  # of the URDF
    root: ET.Element
    notes: tuple[str, ...] = ()  # what could not be carried over
    missing: Mapping[str, list[str]] = field(default_factory=dict)  # missing mesh files by link
    # planes and gravity are in the first link's frame
    planes: tuple[tuple[float, float, float, float], ...] = ()  # unit normals, and heights along them [m]
    gravity: tuple[float, ...] | None = None  # [m/s²], (3,), if stated
    postures: Mapping[str, Mapping[str, float]] | None = None  # positions of joints [rad or m], by name
    passive: Mapping[str, frozenset[str]] = field(default_factory=dict)  # joints, by forces that are not read


def attribute(element: ET.Element, key: str, where: str) -> str:
    """A required, nonempty attribute."""
    value = element.get(key, "")
    if not value:
        raise RobotError(f"{where}: <{element.tag}> has no {key!r}")
    return value


def child(element: ET.Element, tag: str, where: str) -> ET.Element:
    """A required child element."""
    inner = element.find(tag)
    if inner is None:
        raise RobotError(f"{where}: <{element.tag}> has no <{tag}>")
    return inner


def scalar(element: ET.Element, key: str, where: str, default: str | None = None) -> float:
    """A finite number from an attribute, which is required unless there is a default."""
    return vector(element, key, where, default, size=1)[0]


def number_or_zero(text: str | None) -> float:
    """A number in a description; zero if it is missing, unreadable or not finite."""
    try:
        return float(text or "") if math.isfinite(float(text or "")) else 0.0
    except ValueError:
        return 0.0


def positive(element: ET.Element, key: str, where: str, size: int = 1) -> tuple[float, ...]:
    """Positive numbers from an attribute, such as the sizes of a box."""
    values = vector(element, key, where, size=size)
    if min(values) <= 0:
        raise RobotError(f"{where}: <{element.tag} {key}={element.get(key)!r}>, expected more than 0")
    return values


def vector(
    element: ET.Element | None, key: str, where: str, default: str | None = None, size: int = 3
) -> tuple[float, ...]:
    """Finite numbers from an attribute; element and attribute are required unless there is a default."""
    text = element.get(key, default) if element is not None else default
    tag = element.tag if element is not None else ""
    if text is None:
        raise RobotError(f"{where}: <{tag}> has no {key!r}")
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        values = ()
    if len(values) != size or not all(abs(x) <= _LARGEST for x in values):
        count = "a finite number" if size == 1 else f"{size} finite numbers"
        raise RobotError(f"{where}: <{tag} {key}={text!r}>, expected {count} of at most {_LARGEST:g}")
    return values


def origin(owner: ET.Element, where: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Translation [m], and roll, pitch and yaw [rad], of an element's <origin>; zero where it is silent."""
    place = owner.find("origin")
    return vector(place, "xyz", where, "0 0 0"), vector(place, "rpy", where, "0 0 0")


def words(values: Iterable[SupportsFloat]) -> str:
    """Numbers as an attribute's text, exactly."""
    return " ".join(repr(float(x)) for x in values)
