"""What is reported in the tests: coefficients, and an identification."""

from dataclasses import replace

import numpy as np
import pandas as pd
import torch

from sidegan.report.identification.content import Finding, Friction, Report, Signals

JOINTS = ("shoulder", "elbow")
PARAMETERS = pd.DataFrame(
    [
        ("Izz1", "Izz1 + 0.16 m2", "kg·m²", 1.25, 0.01, 0.008, 1.2, 1.26, False),
        ("mx2", "mx2", "kg·m", 3e-5, 1e-3, 33.3, 0.0, 2e-5, True),
        ("fv1", "fv1", "N·m·s", 2.0, 0.1, np.inf, np.nan, 1.9, False),
    ],
    columns=["name", "formula", "unit", "value", "std", "relative_std", "urdf", "consistent", "weak"],
)


def some(family, count):
    """Coefficients [rad/s], (count, J, H, 2)."""
    source = torch.Generator().manual_seed(count)
    return 0.3 * torch.randn(count, *family.shape, dtype=torch.float64, generator=source)


def signals(name, role, count=300):
    """Torques of two joints, with a break in the middle."""
    time = np.linspace(0, 3, count)
    measured = np.stack([np.sin(3 * time), np.cos(5 * time)], 1)
    predicted = measured + 0.01 * np.sin(40 * time)[:, None]
    measured[count // 2] = predicted[count // 2] = np.nan
    return Signals(name, role, time, measured, predicted)


def identification():
    """The content of a report."""
    columns = ("nmse_training", "nmse_validation", "rmse_training", "rmse_validation")
    velocity = np.tile(np.linspace(-1, 1, 11), (2, 1))
    samples = np.random.default_rng(0).normal(size=(900, 2))
    link = {"link": ("upper", "lower")} | dict.fromkeys(("m", "cx", "cy", "cz"), 1.5)
    link |= dict.fromkeys(("Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"), 0.25) | {"urdf_m": (1.4, 1.6)}
    return Report(
        title="planar2",
        verdict="The model can be trusted.",
        level="good",
        advice="Use the consistent model.",
        reasons=["It predicts what was held out."],
        facts={"validation nMSE": "0.0042"},
        joint_names=JOINTS,
        torque_units=["N·m"] * len(JOINTS),
        methods={"weighted": "by their noise"},
        findings=[Finding("ok", "a.csv", "300 samples"), Finding("warning", "b.csv", "a gap of 1 s")],
        errors=pd.DataFrame(np.arange(1, 9).reshape(2, 4) / 1000, columns=columns),
        signals=[signals("a.csv", "training"), signals("b.csv", "validation", 4000)],
        parameters=PARAMETERS,
        covariance=np.array([[1e-4, 0, 0], [0, 1e-6, 9.5e-5], [0, 9.5e-5, 1e-2]]),
        condition_number=123.4,
        friction=Friction(velocity, 2 * velocity, samples, 2 * samples),
        links=pd.DataFrame(link),
        left_over=["joint 1: 70% of what is left is <b>friction</b>."],
        recommendations=["Run trajectory 12."],
        settings="method: weighted",
        files={"the verdict": "verdict.json"},
        command="python -m sidegan.pipeline.run",
    )


def bare():
    """The content of a report of which hardly anything is known."""
    report = identification()
    nothing = {"recommendations": (), "findings": (), "signals": (), "friction": None}
    errors = report.errors[["nmse_training"]]
    return replace(report, level="poor", verdict="No verdict.", errors=errors, **nothing)
