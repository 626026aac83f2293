import subprocess
from pathlib import Path

import pytest

from benchmarks import mutants
from benchmarks.mutants import Mutant
from benchmarks.warm import Warm
from sidegan.errors import ConfigError

pytest.importorskip("cosmic_ray")

SOURCE = "def mean(x):\n    return sum(x) / len(x)\n\n\ndef first(x):\n    return x[0]\n"
TEST = "from sidegan.motion.means import mean\n\n\ndef test_mean():\n    assert mean([1, 3]) == 2\n"
DIVIDED = Mutant("physics", "sidegan/motion/means.py", "ReplaceBinaryOperator_Div_Mul", 0)
SECOND = Mutant("physics", "sidegan/motion/means.py", "NumberReplacer", 0)


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project of two functions, of which one is tested."""
    files = {"sidegan/motion/means.py": SOURCE, "tests/motion/test_means.py": TEST}
    files |= {
        f"{folder}/__init__.py": "" for folder in ("sidegan", "sidegan/motion", "tests", "tests/motion")
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    subprocess.run("git init -q && git add -A", shell=True, cwd=tmp_path, check=True)
    monkeypatch.setattr(mutants, "ROOT", tmp_path)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    return tmp_path


@pytest.fixture(scope="module")
def warm():
    """A process that runs tests, with nothing imported."""
    with Warm(()) as one:
        yield one


def test_mutants_are_of_formulas_and_conditions(project):
    listed = list(mutants.mutants(project))
    assert DIVIDED in listed and SECOND in listed
    assert len(listed) == len(set(listed))
    assert not any("BitOr" in one.operator for one in listed)
    assert mutants.change(DIVIDED, project) == "return sum(x) / len(x) → return sum(x) * len(x)"


def test_what_is_no_python_is_no_mutant(project):
    path = project / "sidegan/motion/means.py"
    path.write_text("def both(a, b):\n    return {**a, **b}\n")
    assert list(mutants.mutants(project)) and mutants.draw(project, 5, 0) == []
    path.write_text("def both(a, b):\n    return {**a, 1: b}, a**2\n")
    drawn = mutants.draw(project, 100, 0)
    assert "NumberReplacer" in {one.operator for one in drawn}
    assert [one.occurrence for one in drawn if one.operator == "ReplaceBinaryOperator_Pow_Add"] == [1]


def test_what_a_test_tells_is_noticed_and_what_none_tells_survives(project, warm):
    found, seconds = mutants.noticed(DIVIDED, project, warm)
    assert found and seconds > 0
    assert not mutants.noticed(SECOND, project, warm)[0]
    assert (project / DIVIDED.file).read_text() == SOURCE


def test_the_nearest_tests_come_first():
    near, *telling, others = mutants.tests_of("sidegan/validity/regions.py", mutants.ROOT)
    others_of_it = [path for path in near if path != "tests/validity/test_regions.py"]
    assert len(others_of_it) == len(near) - 1 and all(len(step) == 1 for step in telling)
    assert all("sidegan.validity.regions import" in (mutants.ROOT / x).read_text() for x in others_of_it)
    every = [*near, *(step[0] for step in telling), *others]
    found = sorted(
        str(path.relative_to(mutants.ROOT)) for path in mutants.ROOT.glob("tests/validity/test_*.py")
    )
    assert set(every) >= set(found) and len(every) == len(set(every))
    near, *telling, others = mutants.tests_of("sidegan/pipeline/stages/readings.py", mutants.ROOT)
    assert "tests/pipeline/test_readings.py" in near
    assert any(step[0].startswith("tests/experiments/") for step in telling)


def test_kernels_that_are_kept_are_those_without_a_mutant(project, tmp_path):
    kept = project.with_name("kernels") / "a.nbi"
    kept.parent.mkdir(exist_ok=True)
    kept.write_text("whole")
    with mutants._kernels(SECOND, project) as folder:
        assert folder == kept.parent
    with mutants._kernels(SECOND._replace(file="sidegan/motion/compiled/means.py"), project) as folder:
        assert (folder / "a.nbi").read_text() == "whole"
        other = folder / "b"
        other.write_text("changed")
        other.replace(folder / "a.nbi")  # as numba does
    assert kept.read_text() == "whole" and not folder.exists()


def test_a_test_that_fails_anyway_notices_nothing(project, warm):
    (project / "tests/motion/test_means.py").write_text("def test_mean():\n    assert False\n")
    with pytest.raises(ConfigError, match=r"test_means.py::test_mean fails without a mutant"):
        mutants.noticed(SECOND, project, warm)
    assert (project / SECOND.file).read_text() == SOURCE


def test_what_has_no_end_is_noticed(project, warm, monkeypatch):
    monkeypatch.setattr(mutants, "_PATIENCE", 3)
    (project / "tests/motion/test_means.py").write_text("def test_mean():\n    while True:\n        pass\n")
    assert mutants.noticed(SECOND, project, warm)[0]


def test_what_grows_without_end_is_noticed(project, warm, monkeypatch):
    monkeypatch.setattr(mutants, "_ROOM", 2**30)
    test = "def test_mean():\n    x = bytes(2**20)\n    while True:\n        x += x\n"
    (project / "tests/motion/test_means.py").write_text(test)
    with pytest.raises(ConfigError, match="fails without a mutant"):
        mutants.noticed(SECOND, project, warm)


def test_a_stopped_run_goes_on_and_the_tree_is_left_alone(project, tmp_path, monkeypatch, capsys):
    work = tmp_path / "work"
    everything = list(mutants.mutants(project))
    monkeypatch.setattr(mutants, "noticed", lambda one, root, warm: (one.operator != "NumberReplacer", 1.5))
    assert mutants.main(["--count", "3", "--work", str(work)]) == 0
    monkeypatch.setattr(mutants, "noticed", lambda *_: pytest.fail("done twice"))
    frame = mutants.run(3, 0, work)
    assert len(frame) == 3 < len(everything)
    assert "Mutants that the tests notice" in capsys.readouterr().out
    assert (project / DIVIDED.file).read_text() == SOURCE


def test_a_killed_run_leaves_no_mutant_behind(project, tmp_path, monkeypatch):
    work = tmp_path / "work"
    path = mutants.copied(project, work / "tree") / DIVIDED.file
    path.rename(path.with_name(f"{path.name}.whole"))
    path.write_text("a mutant")
    whole = lambda one, root, warm: ((root / one.file).read_text() == SOURCE, 0.0)  # noqa: E731
    monkeypatch.setattr(mutants, "noticed", whole)
    assert mutants.run(2, 0, work).noticed.all()


def test_changed_files_are_told(project):
    with pytest.raises(ConfigError, match="has changed"):
        mutants.mutated(DIVIDED._replace(occurrence=7), SOURCE)


def test_tests_of_rooms_that_use_a_file_count_too():
    """Through others of its own room: kernels are what the designer and the plant run on."""
    *_, last = mutants.tests_of("sidegan/motion/compiled/apart.py", mutants.ROOT)
    rooms = {Path(file).parts[1] for file in last}
    assert {"motion", "designer"} <= rooms and not rooms & {"pipeline", "report"}
    *_, last = mutants.tests_of("sidegan/motion/compiled/servos.py", mutants.ROOT)
    assert "plant" in {Path(file).parts[1] for file in last}
