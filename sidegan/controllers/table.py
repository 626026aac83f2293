"""A course as a table, in the columns that ``identify`` reads without a setting."""

import torch

from sidegan.controllers.course import Course

_NUMBER = "%.9g"
_LETTERS = {"position": "q", "velocity": "dq", "acceleration": "ddq"}


def csv_text(course: Course) -> str:
    """``time`` [s], then ``q_<joint>``, ``dq_<joint>`` and ``ddq_<joint>`` of every joint in SI units."""
    columns = ["time", *(f"{letter}_{name}" for letter in _LETTERS.values() for name in course.joint_names)]
    rows = torch.cat([course.time[:, None], *(getattr(course, name) for name in _LETTERS)], 1)
    line = ",".join([_NUMBER] * len(columns))  # five times as fast as by pandas
    return "\n".join([",".join(map(_quoted, columns)), *(line % tuple(row) for row in rows.tolist()), ""])


def _quoted(name: str) -> str:
    """A name as CSV takes it."""
    if any(mark in name for mark in ',"\r\n'):
        return '"' + name.replace('"', '""') + '"'
    return name
