"""Texts and tables of an identification's report."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from sidegan.base.names import listed
from sidegan.identification.estimate import nmse_text
from sidegan.identification.identified import CONSISTENT, EQUAL_WEIGHTS, IdentifiedArm
from sidegan.identification.payload import VALUES, values_of
from sidegan.identification.verdict import BAD, Quality, joint_of
from sidegan.identification.workflow import error_ratio
from sidegan.recording.checked import CheckedRecording

_NAMED = 6  # joints or parameters in a sentence, at most
_UNITS = {"m": "kg", "mx": "kg·m", "my": "kg·m", "mz": "kg·m", "I": "kg·m²"}
_UNITS |= {"fv": "N·m·s/rad", "fd": "N·m·s/rad", "fr": "N·m/(rad/s)^½"}
_OF_SLIDES = {"Ia": "kg", "fv": "N·s/m", "fd": "N·s/m", "fr": "N/(m/s)^½"}  # the same of prismatic joints


class Origin(NamedTuple):
    """Commands and settings of an identification."""

    command: str  # that reproduces it
    excite: str  # that designs trajectories for the arm
    settings: Mapping[str, Any]  # by group, plain values


def headline(identified: IdentifiedArm) -> str:
    """The verdict, and the error that it is based on."""
    error = nmse_text(identified.tested[identified.use].nmse_mean)
    return f"{identified.quality.verdict}: mean nMSE {error} ({identified.kind})"


def advice(identified: IdentifiedArm) -> str:
    """Which model to use and why, and the error of the description, a sentence each."""
    error = nmse_text(identified.quality.nominal_score.nmse_mean)
    described = f"The description's own links, with friction fitted to the data, have a mean nMSE of {error}"
    return f"{_use(identified)} {described} on {identified.quality.where}."


def _use(identified: IdentifiedArm) -> str:
    use = identified.use
    method = identified.chosen.method
    quality = identified.quality
    if quality.other_gravity:
        return "Use none of these models: their links compensate for a gravity unlike the description's."
    if not quality.judged.nmse_mean < 1:
        return "Use none of these models: none predicts better than the mean torque."
    if quality.verdict == BAD:
        return f"Use none of these models: {_needed(quality)}."
    if identified.tested is identified.trained:
        return (
            "Use the consistent model, whose links are physically possible: nothing was held out to compare "
            f"it with the others. {_held(identified)}"
        )
    consistent, other = (nmse_text(identified.tested[name].nmse_mean) for name in (CONSISTENT, method))
    compared = f"mean nMSE {consistent} against {other} of the {method} one, {identified.kind}"
    if use == CONSISTENT:
        return (
            "Use the consistent model: physically possible links predict as well or better "
            f"({compared}). {_held(identified)}"
        )
    worse = error_ratio(method, identified.tested)
    return (
        f"Use the {method} model, which is in the Python class and the C header: no physically possible "
        f"links predict as well, their nMSE is {worse:.2g} times as large, geometric mean over joints "
        f"({compared}). The URDF and the MJCF hold the consistent one, since simulators reject others."
    )


def _needed(quality: Quality) -> str:
    """What is needed for a usable model."""
    if quality.faulty:
        return "they mean nothing until the problem named first is fixed"
    joints = sorted(
        {finding.joint for finding in quality.findings if finding.level == BAD and finding.joint is not None}
    )
    if not joints:
        return "something that acts on the joints is not modelled; the residuals show what it looks like"
    names = listed([quality.joint(j) for j in joints], _NAMED)
    weak = listed([name for name in quality.weak if joint_of(name) in joints], _NAMED)
    motion = f"a motion that excites {weak}, or " if weak else ""
    return f"{names} cannot be modelled well yet: this needs {motion}a model of what else acts there"


def _held(identified: IdentifiedArm) -> str:
    """Which files hold the consistent model, and the terms that some of them cannot hold."""
    has = {*identified.model.kinds, *("effects" for _ in identified.effects)}
    both = [what for kind, what in (("offset", "offsets"), ("effects", "effects on joints")) if kind in has]
    missing = [f"{' and '.join(both)} (not in the URDF and the MJCF)"] if both else []
    missing += ["rotors (not in the URDF)"] if "rotor_inertia" in has else []
    but = f", except {' and '.join(missing)}" if missing else ""
    return f"The URDF, the MJCF, the Python class and the C header hold it{but}."


def recommendations(identified: IdentifiedArm, command: str) -> list[str]:
    """Motions to record next, a sentence each, with the command that designs them."""
    if identified.quality.faulty:
        return ["fix what the verdict names first: until then, more motion does not help"]
    if not identified.quality.weak:
        return []
    return [
        "record trajectories optimised for what these recordings left uncertain, and identify from all "
        f"recordings: {command} known=FOLDER, where FOLDER is the folder of this report; add the settings "
        "of your workspace, home and effort",
    ]


def facts(identified: IdentifiedArm) -> dict[str, str]:
    """Key figures at the top of the report."""
    quality, chosen = identified.quality, identified.chosen
    errors = {}
    for method, score in identified.tested.items():
        name = "equal weights" if method == EQUAL_WEIGHTS else method
        advised = method == identified.use and quality.verdict != BAD
        errors[f"nMSE, {name} (use this)" if advised else f"nMSE, {name}"] = nmse_text(score.nmse_mean)
    return {
        **errors,
        "nMSE, description": nmse_text(quality.nominal_score.nmse_mean),
        "condition number": f"{chosen.condition:.3g}",
        "parameters": f"{identified.model.count}, {len(quality.weak)} weak",
        "samples": f"{chosen.samples}",
    }


def treatment(recording: CheckedRecording) -> str:
    """Sentence on a recording's origin and preprocessing."""
    raw = recording.statistics
    use = (
        f"{recording.role}: {raw.samples} samples in {raw.duration:.4g} s at {1 / raw.step:.4g} Hz; "
        f"{'; '.join(recording.statements)}; {recording.kept} samples of {recording.moving:.4g} s in motion "
        "are used"
    )
    derived = f"; {' and '.join(recording.derived)} derived" if recording.derived else ""
    return use + derived


def check_table(recordings: Sequence[CheckedRecording]) -> pd.DataFrame:
    """Ranges, noise, saturation and sign of each joint in the recordings."""
    rows = []
    for recording in recordings:
        load = recording.statistics.load
        position, effort = (recording.statistics.signals[name] for name in ("position", load))
        noise = None if recording.repeated is None else recording.repeated.noise
        fastest = np.abs(np.concatenate([segment.velocity for segment in recording.segments])).max(0)
        for j, name in enumerate(recording.joint_names):
            rows.append(
                {
                    "recording": recording.name,
                    "joint": name,
                    "position": f"{position.lower[j]:.3g} … {position.upper[j]:.3g}",
                    "fastest": f"{fastest[j]:.3g}",
                    load: f"{effort.lower[j]:.3g} … {effort.upper[j]:.3g}",
                    "between repetitions": "—" if noise is None else f"{noise[j]:.2g}",
                    "quantum": f"{effort.quantum[j]:.2g}",
                    "saturated": int(effort.clipped[j]),
                    "agreement with the description": f"{recording.agreement.sign[j]:.2f}",
                    "ratio to the description": f"{recording.agreement.fit.scale[j]:.2g}",
                }
            )
    return pd.DataFrame(rows).set_index(["recording", "joint"])


def error_table(identified: IdentifiedArm) -> pd.DataFrame:
    """Errors of the recommended model, a row per joint: ``nMSE, training``, and so on."""
    uses = {"training": identified.trained}
    if identified.tested is not identified.trained:
        uses["validation"] = identified.tested
    errors = {use: scores[identified.use] for use, scores in uses.items()}
    columns = {f"nMSE, {use}": score.nmse.tolist() for use, score in errors.items()}
    columns |= {f"RMSE, {use}": score.rmse.tolist() for use, score in errors.items()}
    return pd.DataFrame(columns, identified.model.arm.joint_names)


def parameter_table(identified: IdentifiedArm) -> pd.DataFrame:
    """A row per identified parameter; ``urdf`` is NaN for terms, which the description lacks."""
    quality, chosen, model = identified.quality, identified.chosen, identified.model
    nominal = [x if i < model.rigid else math.nan for i, x in enumerate(model.nominal.tolist())]
    kinds = [name.rstrip("0123456789") for name in chosen.names]
    prismatic = [model.arm.prismatic[joint_of(name)] for name in chosen.names]
    return pd.DataFrame(
        {
            "name": chosen.names,
            "formula": model.formulas,
            "unit": [_unit(kind, slides) for kind, slides in zip(kinds, prismatic)],
            "value": chosen.parameters.tolist(),
            "std": chosen.deviation.tolist(),
            "urdf": nominal,
            "consistent": identified.estimates[CONSISTENT].parameters.tolist(),
            "weak": [name in quality.weak for name in chosen.names],
        }
    )


def _unit(kind: str, slides: bool) -> str:
    """Unit of a kind of parameter, of a prismatic joint if it slides; effects' are torques by default."""
    usual = _UNITS.get(kind, _UNITS.get(kind[:1], "N" if slides else "N·m"))
    return _OF_SLIDES.get(kind, usual) if slides else usual


def link_table(identified: IdentifiedArm) -> pd.DataFrame:
    """Mass, centre of mass and inertia about it, for every link of the consistent model."""
    arm = identified.model.arm
    table = pd.DataFrame(values_of(identified.links), columns=["m", *VALUES[1:]])
    table.insert(0, "link", arm.link_names)
    return table.assign(urdf_m=arm.inertial_parameters[:, 0])
