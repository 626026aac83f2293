"""The growth curves: resumable, and each point is what it says."""

import numpy as np
import pandas as pd
import pytest

from benchmarks import curves, growth
from benchmarks.growth import exponent


def test_a_curve_goes_on_where_it_was(tmp_path, capsys):
    arguments = ["--small", "--curves", "samples", "--folder", str(tmp_path), "--repeats"]
    assert growth.main([*arguments, "1"]) == 0
    assert capsys.readouterr().err.count("samples at") == 2
    table = tmp_path / "samples.csv"
    rows = pd.read_csv(table)
    assert rows[["at", "repeat"]].values.tolist() == [[20, 0], [40, 0]]
    rows.assign(gram_ms=123.0).to_csv(table, index=False)
    assert growth.main([*arguments, "2"]) == 0
    assert capsys.readouterr().err.splitlines() == ["samples at 20, 2 …", "samples at 40, 2 …"]
    again = pd.read_csv(table)
    assert again[["at", "repeat"]].values.tolist() == [[20, 0], [20, 1], [40, 0], [40, 1]]
    assert (again["gram_ms"] == 123.0).tolist() == [True, False, True, False]
    assert (tmp_path / "samples.png").read_bytes().startswith(b"\x89PNG")
    page = (tmp_path / "README.md").read_text()
    assert "## Samples" in page and "| 40 |" in page and "(samples.png)" in page and "## Joints" not in page


def test_every_curve_has_its_points():
    assert len(growth.CURVES) == 7
    for name, curve in growth.CURVES.items():
        assert callable(getattr(curves, name))
        assert len(curve["points"]) >= 4 and len(curve["small"]) == 2 and curve["shown"]
        assert set(curve.get("once", [])) <= set(curve["points"])


def test_long_points_are_measured_once_and_the_others_take_turns():
    curve = growth.CURVES["rls"] | {"points": [1, 2, 9], "once": [9]}
    assert growth.turns(curve, small=False, repeats=2) == [(1, 0), (2, 0), (9, 0), (1, 1), (2, 1)]


@pytest.mark.parametrize("power", [0.0, 1.0, 2.5])
@pytest.mark.parametrize("share", [False, True])
def test_the_exponent_of_a_power_is_that_power(power, share):
    places = np.array([1, 2, 4, 8, 16, 35] * 2)
    rows = pd.DataFrame({"at": places, "cost": 3e-3 * places**power})
    value, error = exponent({"share": share}, rows, "cost")
    assert value == pytest.approx(power + share) and error == pytest.approx(0.0, abs=1e-6)


def test_long_and_short_trajectories_have_the_same_bandwidth_and_rate():
    one, two = curves.long(1), curves.long(2)
    assert (one["coefficients"], two["coefficients"]) == (84, 168)
    assert two["sweep_long_s"] == 2 * 168 * two["evaluation_s"]
    assert all(point["one_long_valid"] == 1 for point in (one, two)) and two["many_short_valid"] == 2


def test_a_chain_repeats_the_arms_joints(arm):
    long = curves.chain(arm, 9)
    assert long.joints == 9 and len(set(long.joint_names)) == 9
    assert long.axis[7].tolist() == arm.axis[0].tolist()
    assert long.capsules.link.tolist() == list(range(9))
    assert long.capsules.radius[8] == long.capsules.radius[1]


@pytest.mark.parametrize("count", [1, 50])
def test_a_library_of_any_size_is_measured_step_by_step(count, monkeypatch):
    monkeypatch.setattr(curves, "_PART", 20)
    point = curves.library(count)
    assert point.keys() >= {*growth.CURVES["library"]["shown"], "peak_mb", "wall_s"}
    assert all(value > 0 for value in point.values())


def test_an_unknown_curve_is_refused(capsys):
    with pytest.raises(SystemExit):
        growth.main(["--curves", "nothing"])
    assert "nothing" in capsys.readouterr().err
