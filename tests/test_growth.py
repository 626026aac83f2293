"""The growth curves: resumable, and each point is what it says."""

import json

import pytest

from benchmarks import curves, growth


def test_a_curve_goes_on_where_it_was(tmp_path, capsys):
    arguments = ["--small", "--curves", "samples", "--folder", str(tmp_path)]
    assert growth.main(arguments) == 0
    assert capsys.readouterr().err.count("samples at") == 2
    known = tmp_path / "points" / "samples-20.json"
    known.write_text(json.dumps({**json.loads(known.read_text()), "gram_ms": 123.0}))
    assert growth.main(arguments) == 0
    assert "samples at" not in capsys.readouterr().err
    lines = (tmp_path / "samples.csv").read_text().splitlines()
    assert lines[0] == "at,gram_ms,gradient_ms,validity_ms"
    assert [line.split(",")[0] for line in lines[1:]] == ["20", "40"] and ",123," in lines[1] + ","
    assert (tmp_path / "samples.png").read_bytes().startswith(b"\x89PNG")


def test_every_curve_has_its_points():
    for name, curve in growth.CURVES.items():
        assert callable(getattr(curves, name))
        assert len(curve.points) >= 4 and len(curve.small) == 2 and curve.shown


def test_a_chain_repeats_the_arms_joints(arm):
    long = curves._repeated(arm, 9)
    assert long.joints == 9 and len(set(long.joint_names)) == 9
    assert long.axis[7].tolist() == arm.axis[0].tolist()
    assert long.capsules.link.tolist() == list(range(9))
    assert long.capsules.radius[8] == long.capsules.radius[1]


@pytest.mark.parametrize("count", [1, 50])
def test_a_library_of_any_size_is_measured_step_by_step(count, monkeypatch):
    monkeypatch.setattr(curves, "_PART", 20)
    point = curves.library(count)
    assert point.keys() >= {"generation_s", "filter_s", "excitation_s", "write_s", "selection_s", "read_s"}
    assert all(value > 0 for value in point.values())


def test_an_unknown_curve_is_refused(capsys):
    with pytest.raises(SystemExit):
        growth.main(["--curves", "nothing"])
    assert "nothing" in capsys.readouterr().err
