"""Many `sensor_msgs/JointState` messages at once from their bytes: ten times as fast as one by one.

Messages of one publisher differ in numbers only, so the places of the numbers are found once, from a message
that rosbags has read, and used for all messages with the same bytes beside them.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sidegan.recording.tables import Numbers

FIELDS = ("position", "velocity", "effort")
NANOSECONDS = 1e-9
_STAMP, _FRAME = 4, 12  # bytes at which the time stamp and the frame's name begin
_LAYOUTS = 8  # that a message is compared with: one for each publisher, and then some


@dataclass(frozen=True, eq=False)
class Layout:
    """Places of the numbers in messages of one publisher.

    Attributes:
        names: of the joints.
        numbers: seconds, nanoseconds and the fields' values in the bytes of a message.
        fixed: where the bytes stand that are alike in all such messages (names and counts), and these bytes.
    """

    names: list[str]
    numbers: np.dtype[np.void]
    fixed: list[tuple[slice, bytes]]

    def fits(self, raw: bytes) -> bool:
        """Whether a message has this layout."""
        return len(raw) == self.numbers.itemsize and all(raw[part] == same for part, same in self.fixed)

    def read(self, raws: Sequence[bytes], joints: Sequence[str], fields: Sequence[str]) -> Numbers:
        """Time [s] and the joints' values, field after field, of N messages, (N, 1 + F J); NaN for none."""
        table = np.frombuffer(b"".join(raws), dtype=self.numbers)
        columns = [(table["sec"] + table["nanosec"] * NANOSECONDS)[:, None]]
        for field in fields:
            count = min(table[field].shape[1], len(self.names))
            order = [self.names.index(j) if j in self.names[:count] else count for j in joints]
            columns.append(
                np.pad(table[field][:, :count], ((0, 0), (0, 1)), constant_values=np.nan)[:, order]
            )
        return np.concatenate(columns, 1)


def layout_of(raw: bytes, message: Any) -> Layout:
    """Layout of a message, given as bytes and as read by rosbags.

    Source: OMG 2018, DDS Interoperability Wire Protocol 2.5, 10.2 (CDR): numbers are aligned to their size.
    """
    order = "<" if raw[1] else ">"
    at = _FRAME
    for place, text in enumerate((message.header.frame_id, *message.name)):
        at = _aligned(at, 4) + 4 + len(text.encode()) + 1
        if place == 0:
            at = _aligned(at, 4) + 4  # the number of names
    fixed, formats, offsets = (
        [slice(2), slice(_FRAME, at)],
        [f"{order}i4", f"{order}u4"],
        [_STAMP, _STAMP + 4],
    )
    for field in FIELDS:
        count = len(getattr(message, field))
        at = _aligned(at, 4) + 4
        fixed.append(slice(at - 4, at))
        at = _aligned(at, 8) if count else at
        formats.append(f"({count},){order}f8")
        offsets.append(at if count else 0)
        at += 8 * count
    names = ["sec", "nanosec", *FIELDS]
    numbers = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": len(raw)})
    return Layout(list(message.name), numbers, [(part, raw[part]) for part in fixed])


class JointStates:
    """Reader of messages, those of a layout at once.

    Args:
        names: of the arm's joints, as the messages have them.
        fields: of the messages that are read.
        decode: message of its bytes.
    """

    def __init__(self, names: Sequence[str], fields: Sequence[str], decode: Callable[[bytes], Any]) -> None:
        self._names, self._fields, self._decode = names, fields, decode
        self._layouts: deque[Layout] = deque(maxlen=_LAYOUTS)

    def read(self, raws: Sequence[bytes]) -> tuple[NDArray[np.bool_], Numbers]:
        """Which of N messages have any of the joints, (N,), and the numbers of all, as ``Layout.read``."""
        groups: dict[Layout, list[int]] = {}
        for place, raw in enumerate(raws):
            groups.setdefault(self._layout_of(raw), []).append(place)
        numbers = np.empty((len(raws), 1 + len(self._fields) * len(self._names)))
        concerned = np.zeros(len(raws), dtype=bool)
        for layout, places in groups.items():
            numbers[places] = layout.read([raws[i] for i in places], self._names, self._fields)
            concerned[places] = bool(set(self._names) & set(layout.names))
        return concerned, numbers

    def _layout_of(self, raw: bytes) -> Layout:
        for layout in self._layouts:
            if layout.fits(raw):
                return layout
        self._layouts.appendleft(layout_of(raw, self._decode(raw)))
        return self._layouts[0]


def _aligned(at: int, size: int) -> int:
    """Next place of a number; the first four bytes do not count."""
    return at + -(at - 4) % size
