"""XML of descriptions: required elements and attributes, and finite numbers."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import SupportsFloat

from sidegan.errors import RobotError

_TAG = re.compile(rb"<[A-Za-z_/][^<>]*>")
_PREFIX = re.compile(rb"(?:^<|\s)([A-Za-z_][\w.-]*):[A-Za-z_][\w.-]*")
_DECLARED, _ROOT = re.compile(rb"\sxmlns:([\w.-]+)\s*="), re.compile(rb"<(?:robot|mujoco)\b")
_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_LARGEST = 1e18  # of any number in SI units, so that products of a few are finite


@dataclass(frozen=True)
class Source:
    """A description as URDF."""

    text: bytes  # of the URDF
    root: ET.Element
    notes: tuple[str, ...] = ()  # what could not be carried over
    # planes and gravity are in the first link's frame
    planes: tuple[tuple[float, float, float, float], ...] = ()  # unit normals, and heights along them [m]
    gravity: tuple[float, ...] | None = None  # [m/s²], (3,), if stated
    postures: Mapping[str, Mapping[str, float]] | None = None  # positions of joints [rad or m], by name


def parse(text: bytes, path: Path) -> ET.Element:
    """The root element of a URDF or MJCF."""
    try:
        root = ET.fromstring(bound(text))
    except (ET.ParseError, ValueError, LookupError) as error:  # LookupError: an unknown encoding
        raise RobotError(f"{path} is not well-formed XML: {error}") from error
    if root.tag not in ("robot", "mujoco"):
        raise RobotError(
            f"{path} is not a robot description: its root element is <{root.tag}>, "
            "expected <robot> or <mujoco>"
        )
    return root


def bound(text: bytes) -> bytes:
    """A description with all its prefixes declared as namespaces: XML requires that, URDF readers do not."""
    declared = {b"xml", b"xmlns", *_DECLARED.findall(text)}
    loose = sorted({prefix for tag in _TAG.findall(text) for prefix in _PREFIX.findall(tag)} - declared)
    names = b"".join(b' xmlns:%s="%s"' % (prefix, prefix) for prefix in loose)
    comments = [match.span() for match in _COMMENT.finditer(text)]
    for match in _ROOT.finditer(text):
        if not any(begin < match.start() < end for begin, end in comments):
            return text[: match.end()] + names + text[match.end() :]
    return text


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


def number(element: ET.Element, key: str, where: str, default: str | None = None) -> float:
    """A finite number from an attribute, which is required unless there is a default."""
    return vector(element, key, where, default, size=1)[0]


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


def words(values: Iterable[SupportsFloat]) -> str:
    """Numbers as an attribute's text, exactly."""
    return " ".join(repr(float(x)) for x in values)
