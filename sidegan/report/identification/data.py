"""Content of the report of an identification: plain arrays and tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd

Numbers = np.ndarray[Any, np.dtype[np.floating[Any]]]
Level = Literal["good", "fair", "poor"]


class Finding(NamedTuple):
    """Something that the check of the data says."""

    level: Literal["ok", "warning", "error"]  # how bad it is
    where: str  # the recording, or the joint
    text: str  # a sentence


class Signals(NamedTuple):
    """Torques of one recording [N·m or N]; a row of NaN breaks the line."""

    name: str  # of the recording
    role: Literal["training", "validation"]  # what it was used for
    time: Numbers  # [s], (S,)
    measured: Numbers  # (S, J)
    predicted: Numbers  # of the same states by the identified model, (S, J)

    @property
    def residual(self) -> Numbers:
        """Measured less predicted torque, (S, J)."""
        return self.measured - self.predicted


class Friction(NamedTuple):
    """Friction of each joint."""

    velocity: Numbers  # of the curve [rad/s or m/s], (J, K)
    torque: Numbers  # identified friction with offset [N·m or N], (J, K)
    measured_velocity: Numbers  # of samples, (N, J)
    measured: Numbers  # their torque less that of the rigid body, (N, J)


@dataclass(frozen=True, eq=False)
class Report:
    """Content of the report of an identification, in the order in which it is shown."""

    title: str  # the arm
    verdict: str  # whether to trust the model, in a sentence
    level: Level  # of the verdict
    reasons: Sequence[str]  # for the verdict, a sentence each
    facts: Mapping[str, str]  # what → how much, shown large
    joint_names: Sequence[str]  # of the J joints
    findings: Sequence[Finding]  # of the check of the data
    errors: pd.DataFrame  # a row per joint, in order, with columns nmse_ and rmse_ of training and validation
    signals: Sequence[Signals]  # one per recording
    parameters: pd.DataFrame  # of ``results.parameter_table``
    covariance: Numbers  # of the parameters' errors in their order, (P, P)
    condition_number: float  # of the weighted regressor
    singular_values: Numbers  # of the same, (P,)
    friction: Friction | None  # curves and samples; None of a model without any
    links: pd.DataFrame  # consistent inertial parameters, of ``results.link_table``
    recommendations: Sequence[str]  # what to do next, a sentence each
    settings: str  # as text
    files: Mapping[str, str]  # what → name of a file beside the report
    command: str  # that made it


def correlation_of(covariance: Numbers) -> Numbers:
    """Correlation (P, P) of a covariance; a parameter without variance is correlated with none."""
    deviation = np.sqrt(np.diag(covariance))
    scale = np.where(deviation > 0, deviation, 1.0)
    correlation = covariance / scale / scale[:, None]
    np.fill_diagonal(correlation, 1.0)
    return np.clip(correlation, -1.0, 1.0)
