"""The names at the top of the package, and the cell that everything begins with."""

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np

import sidegan as sg


def test_every_public_name_exists_at_run_time_and_for_type_checkers():
    tree = ast.parse(Path(sg.__file__).read_text(encoding="utf-8"))
    (typed,) = (node for node in tree.body if isinstance(node, ast.If))
    assert sorted(alias.name for node in typed.body for alias in node.names) == sorted(sg.__all__)
    assert set(sg.__all__) <= set(dir(sg))
    assert all(hasattr(sg, name) for name in sg.__all__) and not hasattr(sg, "sedes")


def test_importing_the_package_imports_nothing_unused():
    code = "import sys, sidegan; print(*{'torch', 'numpy', 'pandas', 'hydra'} & sys.modules.keys())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_a_cell_takes_what_it_is_told():
    stated = sg.Cell("planar2", effort=0.5, clearance=0.01, home=np.array([0.1, 0.2]))
    assert (stated.effort, stated.home, stated.constraints.clearance) == (0.5, (0.1, 0.2), 0.01)
    assert "effort" not in " ".join(stated.notes)
    assert sg.Cell("planar2", limits="joint_limits.yaml").setup.limits.file == "joint_limits.yaml"


def test_a_region_in_millimetres_is_doubted():
    far = {"box": {"lower": [300, -300, 0], "upper": [500, 300, 500]}}
    near = {"sphere": {"centre": [0.5, 0, -2], "radius": 0.1}}
    (warning,) = sg.Cell("planar2", workspace={"regions": [near, far]}).warnings
    assert warning.startswith("workspace.regions[1]") and "millimetres" in warning
