"""Content of the report of an identification: plain arrays and tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd

Numbers = np.ndarray[Any, np.dtype[np.floating[Any]]]
Level = Literal["good", "fair", "poor"]


class Finding(NamedTuple):
    """Something that the check of the data says.

    Attributes:
        level: how bad it is.
        where: the recording, or the joint.
        text: a sentence.
    """

    level: Literal["ok", "warning", "error"]
    where: str
    text: str


class Signals(NamedTuple):
    """Torques of one recording [N·m or N]; a row of NaN breaks the line.

    Attributes:
        name: of the recording.
        role: what it was used for.
        time: [s], (S,).
        measured: (S, J).
        predicted: of the same states by the identified model, (S, J).
    """

    name: str
    role: Literal["training", "validation"]
    time: Numbers
    measured: Numbers
    predicted: Numbers

    @property
    def residual(self) -> Numbers:
        """Measured less predicted torque, (S, J)."""
        return self.measured - self.predicted


class Friction(NamedTuple):
    """Friction of each joint.

    Attributes:
        velocity: of the curve [rad/s or m/s], (J, K).
        torque: identified friction with offset [N·m or N], (J, K).
        measured_velocity: of samples, (N, J).
        measured: their torque less that of the rigid body, (N, J).
    """

    velocity: Numbers
    torque: Numbers
    measured_velocity: Numbers
    measured: Numbers


@dataclass(frozen=True, eq=False)
class Report:
    """Content of the report of an identification, in the order in which it is shown.

    Attributes:
        title: the arm.
        verdict: whether to trust the model, in a sentence.
        level: of the verdict.
        reasons: for the verdict, a sentence each.
        facts: what → how much, shown large.
        joint_names: of the J joints.
        findings: of the check of the data.
        errors: a row per joint, in order, with columns nmse_ and rmse_ of training and validation.
        signals: one per recording.
        parameters: a row per parameter, of ``results.parameter_table``; relative_std is a share, urdf
            is NaN where nothing is known.
        covariance: of the parameters' errors in their order, (P, P).
        condition_number: of the weighted regressor.
        singular_values: of the same, (P,).
        friction: curves and samples.
        links: consistent inertial parameters about the centre of mass, of ``results.link_table``.
        recommendations: what to do next, a sentence each.
        settings: as text.
        files: what → name of a file beside the report.
        command: that made it.
    """

    title: str
    verdict: str
    level: Level
    reasons: Sequence[str]
    facts: Mapping[str, str]
    joint_names: Sequence[str]
    findings: Sequence[Finding]
    errors: pd.DataFrame
    signals: Sequence[Signals]
    parameters: pd.DataFrame
    covariance: Numbers | None = None
    condition_number: float | None = None
    singular_values: Numbers | None = None
    friction: Friction | None = None
    links: pd.DataFrame | None = None
    recommendations: Sequence[str] = ()
    settings: str = ""
    files: Mapping[str, str] = field(default_factory=dict)
    command: str = ""
