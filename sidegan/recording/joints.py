"""The arm's joints as a file names and numbers them."""

from collections.abc import Sequence
from dataclasses import dataclass

from sidegan.base.names import counted
from sidegan.errors import RecordingError
from sidegan.recording.settings import PLACEHOLDER, Columns


@dataclass(frozen=True)
class Joints:
    """Names and numbers of the arm's joints in a file."""

    # names in the file of the arm's joints and of locked ones between them, from the base outwards
    chain: tuple[str, ...]
    places: tuple[int, ...]  # which of these are the arm's
    own: tuple[str, ...]  # names of the arm's joints in its description

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the arm's joints in the file."""
        return tuple(self.chain[place] for place in self.places)


def joints_of(
    file: str, columns: Columns, joint_names: Sequence[str], chain: Sequence[str] | None = None
) -> Joints:
    """The arm's joints in a file, as part of a chain in which others may be locked; None: there are none.

    Raises:
        RecordingError: when the names that are set are not as many as the joints.
    """
    own, every = tuple(joint_names), tuple(chain or joint_names)
    named = tuple(columns.joints or every)
    if len(named) == len(every):
        return Joints(named, tuple(every.index(name) for name in own), own)
    if len(named) == len(own):
        return Joints(named, tuple(range(len(own))), own)
    raise RecordingError(
        f"{file}: recording.joints has {counted(len(named), 'name')}, the arm has "
        f"{counted(len(own), 'joint')}: {', '.join(own)}"
    )


def header_of(patterns: Sequence[str], joints: Joints) -> list[str]:
    """Columns of a text without a first line of names, of patterns that stand for those of all joints."""
    every = range(len(joints.chain))
    return [name for pattern in patterns for name in filled(pattern, joints.chain, every)]


def filled(pattern: str, names: Sequence[str], places: Sequence[int]) -> list[str]:
    """Columns of a pattern for joints of these names and places, counted from 0; or the one array of all."""
    if not PLACEHOLDER.search(pattern):
        return [pattern]
    each = [{"joint": n, "index": str(p + 1), "index0": str(p)} for n, p in zip(names, places)]
    return [PLACEHOLDER.sub(lambda match, one=one: one[match[1]], pattern) for one in each]  # type: ignore[misc]
