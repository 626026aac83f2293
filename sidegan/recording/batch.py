"""Messages with joint states, gathered and read together."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from sidegan.recording.cdr import Layout, layout_of
from sidegan.recording.tables import Numbers, Piece

_NANOSECONDS = 1e-9
_LAYOUTS = 8  # that a message is compared with: one for each publisher, and then some


class Batch:
    """Messages that wait to be read together, a list for each layout.

    Args:
        names: of the arm's joints, as the messages have them.
        fields: of the messages, by signal.
    """

    def __init__(self, names: Sequence[str], fields: dict[str, str]) -> None:
        self._names, self._fields = names, fields
        self._layouts: list[Layout] = []
        self._row = 0
        self._clear()

    def _clear(self) -> None:
        self._received: list[int] = []
        self._raws: dict[int, list[bytes]] = {}
        self._places: dict[int, list[int]] = {}
        self._single: dict[int, list[Numbers]] = {}

    def __len__(self) -> int:
        return len(self._received)

    def add(self, received: int, raw: bytes, decode: Callable[[bytes], Any]) -> None:
        """Take in a message that came at a time [ns]."""
        number = self._number(raw)
        if number is None:
            row = self._decoded(decode(raw))
            if row is not None:
                self._single[len(self._received)] = row
                self._received.append(received)
        elif set(self._names) & set(self._layouts[number].names):
            self._places.setdefault(number, []).append(len(self._received))
            self._raws.setdefault(number, []).append(raw)
            self._received.append(received)

    def piece(self) -> Piece:
        """All messages so far, in their order."""
        count = len(self._received)
        found = [
            np.full((count, 1), 0.0),
            *(np.full((count, len(self._names)), np.nan) for _ in self._fields),
        ]
        for number, raws in self._raws.items():
            parts = self._layouts[number].read(raws, self._names, list(self._fields.values()))
            for whole, part in zip(found, parts):
                whole[self._places[number]] = part
        for place, row in self._single.items():
            for whole, values in zip(found, row):
                whole[place] = values
        received = np.array(self._received)[:, None] * _NANOSECONDS
        found[0] = np.where(found[0] == 0, received, found[0])
        first, self._row = self._row + 1, self._row + count
        self._clear()
        columns = {"time": found[0][:, 0], **dict(zip(self._fields, found[1:]))}
        return Piece(columns, np.arange(first, first + count))

    def _number(self, raw: bytes) -> int | None:
        """Number of the message's layout; None when its bytes have to be decoded one by one."""
        for number in range(len(self._layouts) - 1, max(-1, len(self._layouts) - _LAYOUTS - 1), -1):
            if self._layouts[number].fits(raw):
                return number
        layout = layout_of(raw)
        if layout is not None:
            self._layouts.append(layout)
        return None if layout is None else len(self._layouts) - 1

    def _decoded(self, message: Any) -> list[Numbers] | None:
        """Time and numbers of one message; None when it knows none of the joints."""
        place = {name: i for i, name in enumerate(message.name)}
        if not set(self._names) & set(place):
            return None
        stamp = message.header.stamp
        fields = [getattr(message, field) for field in self._fields.values()]
        order = [place.get(name, -1) for name in self._names]
        values = [np.array([x[i] if 0 <= i < len(x) else np.nan for i in order]) for x in fields]
        return [np.array([stamp.sec + stamp.nanosec * _NANOSECONDS]), *values]
