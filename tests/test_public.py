"""The names at the top of the package: what they are, and the work of a lab by them, small."""

import ast
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch

import sidegan as sg
from sidegan.design.excitation import information_of
from sidegan.gan.settings import variant_recipe
from sidegan.steps.identify import check_recordings

GENERATOR = {"width": 16, "noise": 8, "batch": 20, "corrections": 1}
SMALL = {"epochs": 2, "steps": 2, "generator": GENERATOR}
SEARCH = {"evaluations": 60, "patience": 60}
FAR = {"lower": [300, -300, 0], "upper": [500, 300, 500]}  # a box in millimetres


@pytest.fixture(scope="module")
def cell():
    """The planar arm, with nothing around it."""
    return sg.Cell("planar2", harmonics=3, period=8, workspace={"desk": None})


@pytest.fixture(scope="module")
def excitation(cell):
    return sg.excite(cell, count=3, seed=0, search=SEARCH)


@pytest.fixture(scope="module")
def seeds(cell):
    return sg.seeds(cell, 60, settings={"steps": 20, "samples": 20, "batch": 20}, workers=1)


def test_every_public_name_exists_at_run_time_and_for_type_checkers():
    tree = ast.parse(Path(sg.__file__).read_text(encoding="utf-8"))
    (typed,) = (node for node in tree.body if isinstance(node, ast.If))
    assert sorted(alias.name for node in typed.body for alias in node.names) == sorted(sg.__all__)
    assert set(sg.__all__) <= set(dir(sg))
    with pytest.raises(AttributeError, match="no attribute 'sedes'"):
        sg.sedes  # noqa: B018


def test_importing_the_package_imports_nothing_unused():
    code = "import sys, sidegan; print(*{'torch', 'numpy', 'pandas', 'hydra'} & sys.modules.keys())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_a_cell_reports_its_decisions_and_refuses_bad_input(cell):
    assert cell.home == (0, 0) and cell.effort == 0.8 and cell.warnings == []
    assert any("effort: 80% of the velocity and torque limits" in note for note in cell.notes)
    stated = sg.Cell("planar2", effort=0.5, clearance=0.01, home=np.array([0.1, 0.2]))
    assert (stated.effort, stated.home, stated.constraints.clearance) == (0.5, (0.1, 0.2), 0.01)
    assert "effort" not in " ".join(stated.notes)
    with pytest.raises(AttributeError):
        cell.effort = 0.3
    assert sg.Cell("planar2", limits="joint_limits.yaml").setup.limits.file == "joint_limits.yaml"
    far = {"regions": [{"sphere": {"centre": [0.5, 0, -2], "radius": 0.1}}, {"box": FAR}]}
    (warning,) = sg.Cell("planar2", workspace=far).warnings
    assert warning.startswith("workspace.regions[1] is 300 m away, and") and "millimetres?" in warning
    for words, wrong in [
        ("did you mean tip", {"tipp": "x"}),
        ("effort is 3", {"effort": 3}),
        ("are these degrees", {"workspace": {"regions": [{"mesh": {"file": "a.stl", "rpy": [90, 0, 0]}}]}}),
    ]:
        with pytest.raises(sg.SideganError, match=words):
            sg.Cell("planar2", **wrong)


def test_a_set_is_valid_reproducible_and_reloads(cell, excitation, tmp_path):
    assert excitation.coefficients.shape == (3, 2, 3, 2) and excitation.valid.all()
    same = sg.excite(cell, count=3, seed=0, search=SEARCH)
    assert np.array_equal(same.coefficients, excitation.coefficients)
    motion, frame = excitation.motion(rate=50), excitation.to_frame(rate=50)
    assert motion.position.shape == (3, 401, 2) and not motion.velocity[:, [0, -1]].any()
    assert len(frame) == 3 * 401 and [*frame][:3] == ["trajectory", "time", "q_shoulder"]
    assert excitation.condition < excitation.conditions.max()  # together at least as evenly as the worst
    assert excitation.save(tmp_path, {"formats": ["csv"]}) == {"1": 8.0, "2": 8.0, "3": 8.0}
    written = pd.read_csv(tmp_path / "trajectories" / "1.csv")
    np.testing.assert_allclose(written.q_elbow, excitation.motion().position[0, :, 1], atol=1e-6)
    again = sg.TrajectorySet.load(tmp_path, cell)
    assert np.array_equal(again.coefficients, excitation.coefficients)
    anew = sg.TrajectorySet.of(cell, again.coefficients)
    np.testing.assert_allclose(anew.conditions, again.conditions, rtol=1e-9)
    assert np.array_equal(excitation[[2, 0]].coefficients, excitation.coefficients[[2, 0]])
    assert len(excitation[-1]) == 1 and len(excitation[1:]) == 2 and len([*excitation]) == 3
    slower = excitation.at_speed(0.5)
    assert slower.family.period == 16 and len(excitation.demands()) == len(slower.demands()) == 3


def test_a_set_is_selected_from_valid_trajectories(cell, excitation):
    c = excitation.coefficients
    pool = sg.TrajectorySet.of(cell, np.concatenate([100 * c[:1], c]))  # the first is far too fast
    assert pool.valid.tolist() == [False, True, True, True]
    for noise in (None, [0.1, 100]):  # on which the choice depends
        information = information_of(cell.body, cell.trajectory, c[:2], noise)
        first = c[np.linalg.slogdet(information)[1].argmax()]
        assert np.array_equal(pool[:3].select(1, "d_optimal", noise).coefficients, first[None])
    assert len(pool.select(3)) == 3
    with pytest.raises(sg.SideganError, match="cannot choose 4 of 3"):
        pool.select(4)
    with pytest.raises(sg.SideganError, match="method is 'best'"):
        pool.select(1, "best")


def test_a_reloaded_set_is_checked_in_its_new_cell(cell, excitation, tmp_path):
    excitation.at_speed(0.5).save(tmp_path / "slow")
    slow = sg.TrajectorySet.load(tmp_path / "slow", cell)
    assert slow.family.period == 16 and slow.valid.all()
    path, same = (
        made.family.derivative(made.coefficients, made.family.times(t), 0)
        for made, t in ((excitation, 10), (slow, 5))
    )
    np.testing.assert_allclose(path, same, atol=1e-9)
    elsewhere = sg.Cell("planar2", harmonics=4, period=9, home=[0.1, 0], workspace={"desk": None})
    weak = sg.TrajectorySet.load(tmp_path / "slow", elsewhere)
    assert np.array_equal(weak.motion().position, slow.motion().position)
    near = {"sphere": {"centre": [0, 0, 1.3], "radius": 0.2}}  # where the set begins
    blocked = sg.Cell("planar2", harmonics=3, home=[1.5, 0], workspace={"desk": None, "regions": [near]})
    assert not sg.TrajectorySet.load(tmp_path / "slow", blocked).valid.any()


def test_a_fit_that_fails_repeats_what_was_found_in_the_recordings(cell, excitation, monkeypatch):
    monkeypatch.setattr("sidegan.identification.consistent._OBJECTIVE_SCALES", ())
    part = excitation.to_frame(rate=100)
    q, dq, ddq = (part.filter(regex=f"^{kind}_").to_numpy() for kind in ("q", "dq", "ddq"))
    columns = dict(zip(("tau_shoulder", "tau_elbow"), -(cell.torque(q, dq, ddq) + 2 * dq).T))
    table = part[["time", "q_shoulder", "q_elbow"]].assign(**columns)[part.trajectory == 1]
    with pytest.raises(sg.SideganError, match=r"no physically possible links .*; .* runs against the descr"):
        sg.identify(cell, table)


ENDLESS = """<robot name="two"><link name="base"/>{}</robot>""".format(
    "".join(
        f"""<joint name="{name}" type="continuous"><parent link="{at}"/><child link="{name}_link"/>
        <axis xyz="0 1 0"/><limit velocity="2" effort="90"/></joint><link name="{name}_link"><inertial>
        <mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>"""
        for at, name in (("base", "first"), ("first_link", "second"), ("second_link", "third"))
    )
)


def test_an_arm_with_a_joint_that_stood_still_is_the_one_of_its_cell(tmp_path, monkeypatch):
    """The same file, wherever the process went in between, and the ranges about the same home."""
    (tmp_path / "away").mkdir()
    monkeypatch.chdir(tmp_path)
    Path("arm.urdf").write_text(ENDLESS)
    cell = sg.Cell("arm.urdf", home=[2.0, 0.5, -1.0], locked=None)
    monkeypatch.chdir("away")
    time = np.arange(0, 10, 0.01)
    columns = {"t": time, "q1": 2 + np.sin(time), "q2": 0.4 + 0 * time, "q3": np.cos(time) - 1}
    table = pd.DataFrame(columns | {"tau1": np.sin(3 * time), "tau3": np.cos(2 * time)})
    settings = {"without": ["second"], "joints": ["1", "2", "3"]}
    found = check_recordings(cell, table, recording=settings).arm
    assert found.joint_names == ("first", "third") and found.setup.locked == {"second": 0.4}
    middle = (found.position_lower + found.position_upper) / 2
    np.testing.assert_allclose(middle, [2, -1])


def test_a_set_is_an_array_as_numpy_asks_for_it(excitation):
    c = excitation.coefficients
    for same in (np.asarray(excitation), np.array(excitation, copy=False), np.asarray(excitation, float)):
        assert np.shares_memory(same, c) and not same.flags.writeable
    for other in (np.array(excitation), np.asarray(excitation, np.float32)):
        assert not np.shares_memory(other, c) and other.flags.writeable
        np.testing.assert_allclose(other, c, rtol=1e-6)
    with pytest.raises(ValueError, match="copy"):
        np.asarray(excitation, np.float32, copy=False)


def test_finished_parts_of_seeds_serve_the_same_call_alone(cell, tmp_path):
    less = {"steps": 20, "samples": 20, "batch": 20}

    def made(count=20, seed=0, cell=cell):
        return sg.seeds(cell, count, seed, settings=less, folder=tmp_path, workers=1)

    first = made()
    assert np.array_equal(made(seed=np.int64(0)).coefficients, first.coefficients)
    assert len([*tmp_path.iterdir()]) == 1
    assert not np.array_equal(made(seed=1).coefficients, first.coefficients)
    weak = sg.Cell("planar2", harmonics=3, period=8, workspace={"desk": None}, effort=0.4)
    assert len(made(count=8)) == 8 and made(cell=weak).valid.all()


def test_a_set_keeps_its_numbers_and_measures_itself_by_its_own_family(cell, excitation, tmp_path):
    c = excitation.coefficients.copy()
    kept = sg.TrajectorySet.of(cell, c)
    c[:] = 30
    with pytest.raises(ValueError, match="read-only"):
        kept.coefficients[0] *= 30
    assert np.array_equal(kept.coefficients, excitation.coefficients)
    slow = excitation.at_speed(0.3)
    own = sg.Cell("planar2", harmonics=3, period=8 / 0.3, workspace={"desk": None})
    assert slow.warnings == sg.TrajectorySet.of(own, slow.coefficients).warnings


def test_the_papers_optimiser_needs_no_further_settings(cell):
    less = {"method": "paper", "steps": 1, "ants": 20, "evaluations": 50}
    made = sg.seeds(cell, 2, settings=less, workers=1)
    assert made.valid.all() and np.abs(made.coefficients).max() <= 0.2 * (1 + 1e-6)


REFUSED = [
    ("1 of 2 trajectories are invalid: 2 violates position of shoulder", lambda cell, it: it.save("set")),
    (
        "urscript, which moves 6 revolute joints",
        lambda cell, it: it.select(1).save("set", {"formats": ["urscript"]}),
    ),
    ("speed is 0", lambda cell, it: it.at_speed(0)),
    ("period is .*, expected a number ≤ 100000", lambda cell, it: it.at_speed(1e-9)),
    ("rate is '100'", lambda cell, it: it.to_frame("100")),
    ("no coefficients", lambda cell, it: sg.TrajectorySet.of(cell, np.zeros((0, 2, 3, 2)))),
    ("coefficients: expected an array of numbers", lambda cell, it: sg.TrajectorySet.of(cell, "abc")),
    ("period=16.0, .*period=8", lambda cell, it: cell.check(it[:1].at_speed(0.5))),
    ("position: expected an array of numbers", lambda cell, it: cell.torque("a", 0, 0)),
    ("robot is None, expected text or a path", lambda cell, it: sg.Cell(None)),
    ("folder is 5", lambda cell, it: it.select(1).save(5)),
    ("folder is None", lambda cell, it: sg.TrajectorySet.load(None, cell)),
    ("folder is 5", lambda cell, it: sg.seeds(cell, 2, folder=5)),
    ("folder is 5", lambda cell, it: sg.surrogates(cell, it, 5)),
    ("path is None", lambda cell, it: sg.Generator.load(None, cell)),
    ("cell is 'planar2', expected a Cell", lambda cell, it: sg.excite("planar2", 1)),
    ("cell is 'planar2', expected a Cell", lambda cell, it: sg.identify("planar2", ["a.csv"])),
    ("count is 0", lambda cell, it: sg.excite(cell, 0)),
    ("method is 'papers'", lambda cell, it: sg.seeds(cell, settings={"method": "papers"})),
    ("reads files", lambda cell, it: sg.seeds(cell, settings={"method": "published"})),
    ("settings are 3", lambda cell, it: sg.seeds(cell, settings=3)),
    ("count is '3'", lambda cell, it: sg.seeds(cell, "3")),
    ("seed is -1", lambda cell, it: sg.excite(cell, 1, seed=-1)),
    ("seed is 1.5", lambda cell, it: sg.seeds(cell, 2, 1.5)),
    ("settings are 'parameters', expected GoalSettings", lambda cell, it: sg.excite(cell, goal="parameters")),
    ("recordings is empty", lambda cell, it: sg.identify(cell, None)),
    ("there is no recording .*a.csv", lambda cell, it: sg.identify(cell, Path("a.csv"))),
    ("recording 1 is a data frame without rows", lambda cell, it: sg.identify(cell, pd.DataFrame())),
    ("recording 1 is a ndarray, expected a file", lambda cell, it: sg.identify(cell, np.zeros((2, 3)))),
    ("a data frame that cannot be stored", lambda cell, it: sg.identify(cell, pd.DataFrame({"t": [1, "a"]}))),
    (
        "{position: recording 1 position} has no effort",
        lambda cell, it: sg.identify(cell, {"position": it.to_frame(100)}),
    ),
    ("validation is -0.5", lambda cell, it: sg.identify(cell, "a.csv", -0.5)),
    ("validation is 30", lambda cell, it: sg.identify(cell, "a.csv", 30)),
    ("gains is 1.0", lambda cell, it: sg.identify(cell, "a.csv", gains=1.0)),
    ("gains is .*not zero", lambda cell, it: sg.identify(cell, "a.csv", gains=[2, float("nan")])),
    ("careful is 5", lambda cell, it: it.select(1).save("set", sg.ExportSettings(careful=5.0))),
    ("clearance is -1", lambda cell, it: sg.Cell("planar2", workspace=sg.Workspace(clearance=-1.0))),
    ("rehearse is for the command", lambda cell, it: it.save("set", {"rehearse": True})),
    ("ignores noise", lambda cell, it: it.select(1, noise=[1, 1])),
    ("noise is .*, expected 2", lambda cell, it: it.select(1, "d_optimal", noise=[1])),
    ("none of these 2 trajectories", lambda cell, it: it[[]]),
    ("coefficients are .2, 2, 2, 3, 2.", lambda cell, it: sg.TrajectorySet.of(cell, [it, it])),
    ("cell is 'planar2'", lambda cell, it: sg.TrajectorySet.load("set", "planar2")),
    ("known is 3", lambda cell, it: sg.excite(cell, 1, known=3)),
    ("period=8.0.*period=16.0", lambda cell, it: sg.train("vanilla", sg.Cell("planar2", harmonics=3), it)),
    (
        "no such setting",
        lambda cell, it: sg.train({"_target_": "sidegan.gan.variants.Vanilla", "weigths": {}}, cell, it),
    ),
    ("workers is -3", lambda cell, it: sg.seeds(cell, 3, workers=-3)),
    ("surrogates is {}, expected the folder", lambda cell, it: sg.train("eigen", cell, it, surrogates={})),
    ("box is -1", lambda cell, it: sg.train("vanilla", cell, it, box=-1)),
    ("1 of 2 seeds are invalid in this cell: 1 violate", lambda cell, it: sg.train("vanilla", cell, it)),
    ("1 of 2 seeds are invalid in this cell: 1 violate", lambda cell, it: sg.surrogates(cell, it, "there")),
    ("beyond the box of 0.001", lambda cell, it: sg.train("vanilla", cell, it[[0, 0]], box=0.001)),
    ("all 2 seeds are the same", lambda cell, it: sg.train("vanilla", cell, it[[0, 0]])),
    ("there are no seeds", lambda cell, it: sg.train("vanilla", cell, np.zeros((0, 2, 3, 2)))),
    ("box is inf", lambda cell, it: sg.train("vanilla", cell, it, box=np.inf)),
]


@pytest.mark.parametrize(("words", "wrong"), REFUSED)
def test_a_wrong_argument_is_refused_by_name(words, wrong, cell, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    c = np.zeros((2, 2, 3, 2))
    c[:, 0, 2, 1] = 0.05, 5  # of the shoulder alone: a small motion, and one beyond its range
    with pytest.raises(sg.SideganError, match=words):
        wrong(cell, sg.TrajectorySet.of(cell, c))
    assert not [*tmp_path.rglob("*.csv"), *tmp_path.rglob("*.script")]


def test_a_model_is_identified_from_tables_or_files(cell, excitation, tmp_path, caplog):
    random, tables = np.random.default_rng(0), []
    for number, part in excitation.to_frame(rate=100).groupby("trajectory"):
        q, dq, ddq = (part.filter(regex=f"^{kind}_").to_numpy() for kind in ("q", "dq", "ddq"))
        tau = cell.torque(q, dq, ddq) + 2 * dq + random.normal(0, 0.1, q.shape)
        joints = dict(zip(("tau_shoulder", "tau_elbow"), tau.T))
        tables.append(part[["time", "q_shoulder", "q_elbow"]].assign(**joints))
        tables[-1].to_csv(tmp_path / f"{number}.csv", index=False)
    indexed = tables[0].set_index(pd.to_timedelta(tables[0].time, "s")).drop(columns="time")
    states, torques = (tables[1].filter(regex=kinds) for kinds in ("time|q_", "time|tau_"))
    tables[2].index = pd.to_datetime(tables[2].time, unit="s").rename(None)  # not read, since there is a time
    given = [indexed, {"position": states, "torque": torques}]
    with caplog.at_level("INFO"):
        mixed = sg.identify(cell, given, validation=tables[2:])
    assert "recording 1: 801 samples" in caplog.text and "recording 2 position and 1 more: 801" in caplog.text
    arm = sg.identify(cell, tables[:2], validation=tables[2:])
    np.testing.assert_allclose(mixed.parameters.value, arm.parameters.value, atol=1e-3)  # rounded times
    assert arm.verdict in ("good", "usable") and arm.errors["nMSE, validation"].max() < 0.01
    friction = arm.parameters.set_index("name").value[["fv1", "fv2"]]
    np.testing.assert_allclose(friction, 2, rtol=0.05)
    np.testing.assert_allclose(arm.torque(q, dq, ddq), tau, atol=1)
    arm.save(tmp_path / "model")
    assert {"report.html", "verdict.json", "planar2.urdf"} <= {x.name for x in (tmp_path / "model").iterdir()}
    assert '\'recordings=["recording 1", "recording 2"]\'' in arm.origin.command
    files = sg.identify(cell, [tmp_path / "1.csv", tmp_path / "2.csv"], validation=[tmp_path / "3.csv"])
    np.testing.assert_allclose(files.parameters.value, arm.parameters.value, rtol=1e-6)
    more = sg.excite(cell, 1, known=tmp_path / "model", search=SEARCH, goal={"objective": "parameters"})
    assert more.valid.all()
    with pytest.raises(sg.SideganError, match=r"states are \(3,\), \(3,\), \(3,\), expected three times"):
        arm.torque(*np.zeros((3, 3)))
    with pytest.raises(sg.SideganError, match="states: expected an array of numbers"):
        arm.torque("a", 0, 0)
    with pytest.raises(sg.SideganError, match="recordings is empty"):
        sg.identify(cell, [])
    locked = sg.Cell("planar2", locked={"elbow": 0.0})
    with pytest.raises(sg.SideganError, match=r"elbow is locked at 0 \(robot.locked\), but recorded from -"):
        sg.identify(locked, tables[0])
    still = [table.assign(q_elbow=0.005) for table in tables]
    assert sg.identify(locked, still[0]).arm.model.joints == 1


def test_a_generator_learns_from_seeds_and_reloads(cell, seeds, tmp_path):
    assert seeds.valid.all() and len(seeds) == 60
    networks = {"width": 16, "margin_steps": 8, "feature_steps": 8}
    networks["negatives"] = {
        "vanilla": {"_target_": "sidegan.gan.variants.Vanilla", "weights": {"adversarial": 1}, **SMALL}
    }
    told = sg.surrogates(cell, seeds, tmp_path, workers=1, samples=200, epochs=2, **networks)
    accepted = {f"accepted{size}" for size in ("", "_25", "_50", "_75")}
    explained = {f"r2_{name}" for name in ("spectrum", "diagonal", "energies")}
    assert told.keys() == {"accuracy_paper", "accuracy_broad", "rejected", *accepted, *explained}
    other = sg.Cell("planar2", harmonics=3, period=8, home=[0.1, 0], workspace={"desk": None})
    with pytest.raises(sg.SideganError, match="were trained for another cell: trajectory differ"):
        sg.train("eigen", other, seeds.coefficients, surrogates=tmp_path, **SMALL)
    before = torch.get_rng_state(), np.random.get_state()[1].copy()
    generator = sg.train("eigen", cell, seeds=seeds, surrogates=tmp_path, **SMALL)
    assert torch.equal(before[0], torch.get_rng_state()) and (before[1] == np.random.get_state()[1]).all()
    made = generator.sample(20)
    assert made.shape == (20, 2, 3, 2) and len(generator.history) == 2
    ways = {"rank": 0}, replace(variant_recipe("eigen").weights, rank=0.0)  # to leave out one loss alone
    less = [sg.train("eigen", cell, seeds, surrogates=tmp_path, weights=x, **SMALL).history for x in ways]
    assert less[0].equals(less[1]) and not less[0].equals(generator.history)
    generator.save(tmp_path / "eigen.pt")
    again = sg.Generator.load(tmp_path / "eigen.pt", cell)
    assert np.array_equal(again.sample(20, np.int64(0)), made)
    assert not np.array_equal(again.sample(20, seed=1), made)
    for words, wrong in [("seed is 'a'", (2, "a")), ("seed is -1", (2, -1)), ("sample True", (True,))]:
        with pytest.raises(sg.SideganError, match=words):
            again.sample(*wrong)
    with pytest.raises(sg.SideganError, match=r"cannot write \.: it is a folder"):
        again.save(".")
    with pytest.raises(sg.SideganError, match=r"makes Trajectory\(.*period=8.*, the cell has .*period=4"):
        sg.Generator.load(
            tmp_path / "eigen.pt", sg.Cell("planar2", harmonics=3, period=4, workspace={"desk": None})
        )
    for words, wrong in [("no variant 'eigne'", ["eigne", cell]), ("learns from seeds", ["eigen", cell])]:
        with pytest.raises(sg.SideganError, match=words):
            sg.train(*wrong)


def test_a_training_does_not_depend_on_what_torch_is_set_to_or_on_other_threads(cell, seeds):
    def made():
        return sg.train(
            "vanilla", cell, seeds, **SMALL | {"generator": GENERATOR | {"width": 128, "batch": 60}}
        ).network.state_dict()

    def same(other):
        return all(torch.equal(x, other[name]) for name, x in first.items())

    first = made()
    with ThreadPoolExecutor(2) as threads:
        assert all(map(same, threads.map(lambda _: made(), range(2))))
    before = torch.get_num_threads()
    try:
        torch.set_num_threads(2 if before == 1 else 1)
        torch.set_default_dtype(torch.float64)
        with torch.inference_mode():
            assert same(made())
        assert torch.get_num_threads() != before and torch.get_default_dtype() == torch.float64
    finally:
        torch.set_num_threads(before)
        torch.set_default_dtype(torch.float32)


def test_a_training_shows_its_progress_and_resumes_in_its_folder(cell, seeds, tmp_path, monkeypatch, caplog):
    def made(**options):
        return sg.train("vanilla", cell, seeds, **SMALL | {"epochs": 3} | options).history

    caplog.set_level("INFO")
    monkeypatch.setattr("sidegan.base.progress._INTERVAL", 0)
    whole, ends = made(), []
    assert "epochs of vanilla: 1 of 3" in caplog.text

    def show(done):
        ends.append(done)
        if len(ends) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr("sidegan.steps.train.bar", lambda *_: nullcontext(show))
    with pytest.raises(KeyboardInterrupt):
        made(folder=tmp_path)
    assert made(folder=tmp_path).equals(whole) and ends == [1, 2, 2, 3]  # the second had not been saved
    assert made(folder=tmp_path).equals(whole) and len(ends) == 4 and len([*tmp_path.iterdir()]) == 1
    for other in ({"seed": 1}, {"generator": GENERATOR | {"batch": 30}}, {"box": np.float32(30)}):
        assert not made(folder=tmp_path, **other).equals(whole)
