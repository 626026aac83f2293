"""Descriptions that cannot be used: each number of one made wrong, parts missing, files that are none."""

import os
import re
from collections.abc import Callable, Iterator
from functools import cache, partial
from itertools import cycle, islice
from pathlib import Path

from benchmarks.hostile.case import Case
from sidegan.robot import load_robot, require_consistent
from sidegan.validity import Constraints

_NUMBERS = re.compile(
    r'\b(xyz|rpy|lower|upper|velocity|effort|value|ix[xyz]|iy[yz]|izz|radius|length|size)="([^"]*)"'
)
_NO_NUMBERS = (
    "nan",
    "inf",
    "-inf",
    "1e200",
    "-1e999",
    "abc",
    "1,5",
    "--1",
    "1 2 3 4 5",
    "0x10",
    "${x}",
    "٣ x",
)
_EACH = 3  # of them for every number of the description
_IMPOSSIBLE = {  # of an attribute: values that are numbers, and still cannot be
    "ixx": ("-5", "9"), "iyy": ("-5", "9"), "izz": ("-5",), "mass value": ("-1", "0"), "lower": ("3",),
    "upper": ("-3",), "velocity": ("0", "-1"), "effort": ("-1",), "radius": ("0", "-0.1"), "length": ("-1",),
    "axis xyz": ("0 0 0", "0 1e-200 0", "0 1e15 0"),
}  # fmt: skip
_NEEDED = ("parent", "child", "limit", "mass", "inertia", "cylinder", "sphere")  # elements
_KINDS = ("continuous", "floating", "planar", "spherical", "", "REVOLUTE")
_WORKS = {"type 'continuous'"}  # it gets a range, which is told
_PARTS = 9  # shortened files


@cache
def source() -> str:
    """The description that is spoilt."""
    return load_robot("planar2").urdf.read_text(encoding="utf-8")


def describe(path: Path) -> None:
    """Read a description as the command does before it executes anything on a simulated arm."""
    arm = load_robot(path)
    require_consistent(arm)
    Constraints(arm).refuse_home([0.0] * arm.joints)


def cases() -> Iterator[Case]:
    """All of them."""
    for name, content in [*_numbers(), *_structures(), *_texts()]:
        act = partial(_describe, partial(_written, content))
        yield Case(f"description: {name}", act, works=name in _WORKS)
    for name, make in _FILES.items():
        yield Case(f"description: {name}", partial(_describe, make))


def _describe(make: Callable[[Path], Path], folder: Path) -> None:
    describe(make(folder))


def _written(content: str | bytes, folder: Path) -> Path:
    path = folder / "arm.urdf"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def _numbers() -> Iterator[tuple[str, str]]:
    text, bad = source(), cycle(_NO_NUMBERS)
    for match in _NUMBERS.finditer(text):
        for value in islice(bad, _EACH):
            yield f"{match[1]}={value!r} for {match[2]!r}", _put(text, match.span(2), value)
    for attribute, values in _IMPOSSIBLE.items():
        element, _, key = attribute.rpartition(" ")
        found = re.search(rf'<{element or "[a-z]+"}\b[^<>]*\b{key}="([^"]*)"', text)
        assert found is not None, attribute
        for value in values:
            yield f"{attribute}={value!r}", _put(text, found.span(1), value)


def _put(text: str, span: tuple[int, int], value: str) -> str:
    return text[: span[0]] + value + text[span[1] :]


def _structures() -> Iterator[tuple[str, str]]:
    text = source()
    for element in _NEEDED:
        yield f"no <{element}>", re.sub(rf"<{element}\b[^>]*/>", "", text, count=1)
    for kind in _KINDS:
        yield f"type {kind!r}", text.replace('type="revolute"', f'type="{kind}"', 1)
    for name in ("upper_arm", "forearm"):
        yield f"two links {name}", text.replace("</robot>", f'<link name="{name}"/></robot>')
        yield f"no link {name}", text.replace(f'<link name="{name}"', '<link name="another"')
    yield "two joints of one name", text.replace('"elbow"', '"shoulder"')
    yield "a loop", text.replace('<parent link="base"/>', '<parent link="forearm"/>')
    yield "a mimic", text.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><mimic joint="elbow"/>', 1)
    yield "a lost link", text.replace("</robot>", '<link name="lost"/></robot>')
    yield "no links", "<robot name='x'/>"
    chain = "".join(
        f'<link name="l{k}"/><joint name="j{k}" type="fixed">'
        f'<parent link="{"hand" if k == 1 else f"l{k - 1}"}"/><child link="l{k}"/></joint>'
        for k in range(1, 6001)
    )
    yield "6,000 fixed joints", text.replace("</robot>", f"{chain}</robot>")


def _texts() -> Iterator[tuple[str, str | bytes]]:
    text = source()
    for part in range(1, _PARTS + 1):
        yield f"cut after {part}0 %", text[: len(text) * part // 10]
    yield "empty", ""
    yield "another language", "joints: [1, 2]"
    yield "another root", text.replace("robot", "mujoco")
    yield (
        "a document type",
        f'<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/hostname">]>{text.partition("?>")[2]}',
    )
    yield "an unknown encoding", text.replace('version="1.0"', 'version="1.0" encoding="klingon"')
    yield "nested 200,000 deep", f"<robot>{'<a>' * 200_000}"
    yield "nested and closed", f"<robot>{'<a>' * 90_000}{'</a>' * 90_000}</robot>"
    yield "bytes that are no text", b"\x89PNG\r\n\x1a\n\xff\xfe\x00" * 40
    yield "another version", text.replace("<robot ", '<robot version="9.9" ')


def _pipe(folder: Path) -> Path:
    os.mkfifo(folder / "arm.urdf")
    return folder / "arm.urdf"


def _large(folder: Path) -> Path:
    with (folder / "arm.urdf").open("wb") as file:
        file.truncate(2**36)
    return folder / "arm.urdf"


def _ring(folder: Path) -> Path:
    (folder / "arm.urdf").symlink_to(folder / "arm.urdf")
    return folder / "arm.urdf"


_FILES = {
    "a pipe": _pipe,
    "64 GB of nothing": _large,
    "a link to itself": _ring,
    "a folder": lambda folder: folder,
    "an endless device": lambda folder: Path("/dev/zero"),
    "a missing file": lambda folder: folder / "gone.urdf",
    "a name too long": lambda folder: folder / ("x" * 5000),
    "a NUL in the name": lambda folder: folder / "a\0b.urdf",
    "an unknown home": lambda folder: Path("~nobody_of_that_name/arm.urdf"),
}
