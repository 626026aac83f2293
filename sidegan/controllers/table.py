"""A course as a table with the columns that ``identify`` recognises."""

import csv
import io

import numpy as np

from sidegan.controllers.course import STATES, Course

# A controller with cubic interpolation at 1 kHz divides differences by 1e-9 s³ for the jerk: with nine digits
# its error would be 120 rad/s³.
_DIGITS = "%.12g"


def csv_text(course: Course) -> str:
    """``time`` [s], then ``q_<joint>``, ``dq_<joint>`` and ``ddq_<joint>`` of every joint in SI units."""
    columns = ["time", *(f"{letter}_{name}" for letter in ("q", "dq", "ddq") for name in course.joint_names)]
    rows = np.concatenate([course.time[:, None], *(getattr(course, name) for name in STATES)], 1)
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(columns)
    np.savetxt(text, rows, _DIGITS, ",")
    return text.getvalue()
