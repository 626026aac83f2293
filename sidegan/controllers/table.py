"""A course as a table, in the columns that ``identify`` reads without a setting."""

import pandas as pd
import torch

from sidegan.controllers.course import Course

_LETTERS = {"position": "q", "velocity": "dq", "acceleration": "ddq"}


def csv_text(course: Course) -> str:
    """``time`` [s], then ``q_<joint>``, ``dq_<joint>`` and ``ddq_<joint>`` of every joint in SI units."""
    columns = ["time", *(f"{letter}_{name}" for letter in _LETTERS.values() for name in course.joint_names)]
    rows = torch.cat([course.time[:, None], *(getattr(course, name) for name in _LETTERS)], 1)
    return pd.DataFrame(rows.numpy(), columns=columns).to_csv(index=False, float_format="%.9g")
