"""The C header computes what the Python class does, which is Pinocchio, and compiles without a warning."""

import ctypes
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sidegan.base.storage import write_json
from sidegan.identification.effects import EFFECT_KINDS
from sidegan.report.identification.arm_dynamics import ArmDynamics
from sidegan.report.identification.c_header import c_header
from sidegan.robot import Drives, write_mjcf
from tests.chains import random_chain, random_states, real_links
from tests.identification.recordings import assert_close

KINDS = "rotor_inertia", "viscous", "coulomb", "offset"
COMPILERS = {"c": ("cc", "-std=c99"), "c++": ("c++", "-std=c++11")}
STRICT = "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Werror"
EXPORTED = """
#include "arm.h"
typedef const double *in;
void torque(in q, in dq, in ddq, double *out) { arm_torque(q, dq, ddq, out); }
void friction(in q, in dq, in rigid, double *out) { arm_friction(q, dq, rigid, out); }
void gravity(in q, double *out) { arm_gravity(q, out); }
void mass_matrix(in q, double out[ARM_J][ARM_J]) { arm_mass_matrix(q, out); }
"""
PAGE = Path(__file__).parents[2] / "docs" / "lab_day.md"


def write(folder, arm, kinds=KINDS):
    """An arm's header, and what its Python class reads, with random links, which cannot exist."""
    random, joints = np.random.default_rng(0), arm.joints
    terms = {kind: random.normal(size=joints).tolist() for kind in kinds}
    links = random.normal(size=(joints, 10)).tolist()
    letters = [letter for kind in EFFECT_KINDS.values() for letter in kind.letters] if kinds == KINDS else []
    effects = {f"{letter}{k % joints + 1}": float(random.normal()) for k, letter in enumerate(letters)}
    use = {"method": "weighted", "inertial_parameters": links, "terms": terms, "effects": effects}
    numbers = {"joints": [*arm.joint_names], "gravity": arm.gravity.tolist(), "sign_width": 0.3, "use": use}
    numbers["usual_load"] = random.uniform(1, 2, joints).tolist()
    write_mjcf(arm, real_links(joints, 0), folder / "arm.xml", Drives.none(joints))
    write_json(folder / "parameters.json", numbers | {"mjcf": "arm.xml"})
    (folder / "arm.h").write_bytes(c_header(arm, numbers, ["a.csv"], "good"))
    return ArmDynamics(folder)


def compiled(folder, source, *options, language="c"):
    """Path of what a source becomes that includes a folder's header."""
    compiler, standard = COMPILERS[language]
    if shutil.which(compiler) is None:
        pytest.skip(f"needs a compiler: {compiler}")
    (folder / "main.c").write_text(source, encoding="utf-8")
    command = [compiler, standard, *STRICT, *options, "-x", language, "main.c", "-o", "compiled", "-lm"]
    ran = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    return folder / "compiled"


@pytest.mark.parametrize("kinds", [KINDS, ("offset",)])
@pytest.mark.parametrize("name", ["lwr", "tilted, with joints that slide"])
def test_the_header_computes_what_the_python_class_does(name, kinds, arm, tmp_path):
    if name != "lwr":
        arm = random_chain(5, seed=3)[0]
        assert 0 < arm.prismatic.sum() < 5
    model = write(tmp_path, arm, kinds)
    library = ctypes.CDLL(str(compiled(tmp_path, EXPORTED, "-shared", "-fPIC")))

    def call(function, *inputs, shape=(arm.joints,)):
        out = np.zeros(shape)
        getattr(library, function)(*(x.ctypes for x in (*inputs, out)))
        return out

    states = [np.ascontiguousarray(x) for x in random_states(arm, 50)]
    rows = [*zip(*states)]
    assert_close([call("torque", *row) for row in rows], model.torque(*states))
    assert_close([call("friction", *row) for row in rows], model.friction(*states))
    assert_close([call("gravity", q) for q in states[0]], [model.gravity(q) for q in states[0]])
    masses = [call("mass_matrix", q, shape=(arm.joints, arm.joints)) for q in states[0]]
    assert_close(masses, [model.mass_matrix(q) for q in states[0]])


def test_states_of_another_shape_are_refused_by_the_python_class(planar, tmp_path):
    model, pair, several = write(tmp_path, planar, ("offset",)), np.ones(2), np.ones((3, 2))
    for call, states, shape in (
        (model.torque, (several, several, pair), "(3, 2), (3, 2), (2,)"),
        (model.friction, (several, pair, pair), "(3, 2), (2,), (2,)"),
        (model.friction, (1, 1, 1), "(), (), ()"),
        (model.gravity, (several,), "(3, 2)"),
        (model.mass_matrix, (np.ones(3),), "(3,)"),
    ):
        with pytest.raises(ValueError, match=re.escape(f"states are {shape}, expected")):
            call(*states)


@pytest.mark.parametrize("language", COMPILERS)
def test_names_of_users_stay_in_the_comment(language, planar, tmp_path):
    names = "*/ #error /*", "/*/ ä\n#error {{ q }}"
    write(tmp_path, replace(planar, name=names[0], joint_names=names))
    compiled(tmp_path, '#include "arm.h"\n', "-c", language=language)


def test_the_documented_loop_compiles(arm, tmp_path):
    (source,) = re.findall(r"^```c\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    write(tmp_path, arm)
    compiled(tmp_path, source, "-c")
