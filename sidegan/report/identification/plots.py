"""Plots of an identification, for its report."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sidegan.base.arrays import Array
from sidegan.identification.identified import IdentifiedArm
from sidegan.identification.measurements import Measurements, pieces
from sidegan.recording.checked import CheckedRecording
from sidegan.report import canvas

MEASURED, PREDICTED, RESIDUAL = "#8795a1", "#0b66c3", "#d9480f"
_LINES = (("measured", MEASURED, 1.8), ("predicted", PREDICTED, 1.0), ("difference", RESIDUAL, 0.8))
_WIDE, _PIXEL = 11.25, 1 / 96  # width of a section, and size of a pixel [inch]
_CURVE, _CLOUD = 101, 300  # points of a friction curve, and samples around it


def torque_figure(identified: IdentifiedArm, recording: CheckedRecording) -> Figure:
    """Measured torque of a recording, the recommended model's and their difference, a row per joint."""
    titles = _titles(identified)
    figure = canvas.blank(_WIDE, (104 * len(titles) + 80) * _PIXEL)
    rows = figure.subplots(len(titles), sharex=True, squeeze=False)[:, 0]
    for segment in recording.segments:
        parts = pieces(Measurements(*segment[1:]))
        theta = identified.used.parameters
        predicted = np.concatenate([identified.model.torque(theta, *part.inputs) for part in parts])
        drawn = zip(_LINES, (segment.torque, predicted, segment.torque - predicted))
        for (label, colour, width), values in drawn:
            for axis, y in zip(rows, values.T):
                axis.plot(segment.time, y, color=colour, linewidth=width, label=label)
    for axis, title in zip(rows, titles):
        axis.set_title(title, loc="left", fontsize=9)
        axis.locator_params("y", nbins=5)
        axis.margins(x=0)
        canvas.tidy(axis)
    rows[-1].set_xlabel("time [s]", fontsize=9)
    return _with_legend(figure, rows[0])


def friction_figure(identified: IdentifiedArm) -> Figure:
    """Friction against velocity: the identified law, over samples of torque minus the rigid body's."""
    model = identified.model
    theta = identified.used.parameters
    titles = _titles(identified)
    columns = min(4, len(titles))
    rows = -(-len(titles) // columns)
    figure = canvas.blank(_WIDE, (230 * rows + 40) * _PIXEL)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis in axes[len(titles) :]:
        axis.remove()
    segments = [segment[1:5] for recording in identified.training for segment in recording.segments]
    q, dq, ddq, torque = (np.concatenate(x) for x in zip(*segments))
    shown = np.linspace(0, len(q) - 1, _CLOUD).astype(int)
    q, dq, ddq, torque = (x[shown] for x in (q, dq, ddq, torque))

    def law(velocity: Array) -> Array:
        """Friction and offset [N·m or N], (S, J)."""
        still = np.zeros_like(velocity)
        return model.regressor(still, velocity, still)[..., model.rigid :] @ theta[model.rigid :]

    rest = torque - model.torque(theta, q, dq, ddq) + law(dq)
    velocity = np.linspace(-1, 1, _CURVE)[:, None] * np.abs(dq).max(0)
    curve = law(velocity)
    dots = {"color": MEASURED, "markersize": 2.4, "markeredgewidth": 0, "alpha": 0.5}
    speeds = [f"velocity [{'m/s' if slides else 'rad/s'}]" for slides in model.arm.prismatic.tolist()]
    for j, (axis, title) in enumerate(zip(axes, titles)):
        axis.plot(dq[:, j], rest[:, j], "o", **dots, label="samples")
        axis.plot(velocity[:, j], curve[:, j], color=RESIDUAL, linewidth=1.6, label="identified")
        axis.set_title(title, fontsize=9)
        axis.set_xlabel(speeds[j] if j + columns >= len(titles) else "", fontsize=9)
        axis.margins(x=0)
        canvas.tidy(axis)
    return _with_legend(figure, axes[0])


def _titles(identified: IdentifiedArm) -> list[str]:
    """Names of joints with the units of their torques."""
    arm = identified.model.arm
    units = ["N" if slides else "N·m" for slides in arm.prismatic.tolist()]
    return [f"{name} [{unit}]" for name, unit in zip(arm.joint_names, units)]


def _with_legend(figure: Figure, axis: Axes) -> Figure:
    """The figure with a legend of the lines of an axis."""
    handles, labels = axis.get_legend_handles_labels()
    canvas.legend(figure, dict(zip(labels, handles)))
    return figure
