"""Functions that hold an experiment, values that are meant, and cases that end at the last moment."""

import logging
from dataclasses import replace

import pytest

from exumob.ground.terrain import Terrain
from exumob.mobility.crossing import Crossing
from exumob.support.quantities import Unusual
from exumob.sweeps import processes, study
from exumob.sweeps.case_store import CaseStore
from exumob.sweeps.experiment import Experiment, amphibious_crossing, amphibious_lane_change
from exumob.sweeps.run import _with_experiment
from exumob.sweeps.study import _marked, read_study
from exumob.sweeps.trust_of_sweep import trust_of_sweep
from exumob.vehicle.start_pose import StartPose
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water


class Plain:
    """Holds an experiment without being a dataclass."""

    def __init__(self, experiment):
        self.experiment = experiment

    def __call__(self, case):
        """Numbers by name."""
        return {"y": case["hull.mass"]}


def of_experiment(case):
    """Numbers by name."""
    return {"y": case["hull.mass"]}


AUTO = replace(amphibious_crossing(), hydrodynamics="auto")


@pytest.mark.parametrize(
    "make", [Crossing, Plain, lambda experiment: experiment], ids=["dataclass", "object", "itself"]
)
def test_one_model_for_all_cases(make):
    given = make(AUTO)
    settled = _with_experiment(given, AUTO.with_one_model([{"hull.mass": 45.0}]))
    held = settled if isinstance(settled, Experiment) else settled.experiment
    assert held.hydrodynamics in ("networks", "coefficients")
    assert isinstance(given, Experiment) or given.experiment.hydrodynamics == "auto", "the given one is left alone"


def test_messages_say_of_which_case_they_are(caplog):
    with processes._messages_named(7, {"water.depth": 0.1, "soil": "LETE sand", "share [%]": 3, "more": 1}):
        logging.getLogger("exumob.simulation.run").warning("%s slides by %.1f %%", "quad", 0.5)
        logging.getLogger("another").warning("as it is")
    logging.getLogger("exumob.simulation.run").warning("after it")
    assert [record.getMessage() for record in caplog.records] == [
        "case 7 (water.depth = 0.1, soil = 'LETE sand', share [%] = 3): quad slides by 0.5 %", "as it is", "after it",
    ]  # fmt: skip


def test_a_function_whose_experiment_cannot_be_replaced_is_refused(monkeypatch):
    monkeypatch.setattr(of_experiment, "experiment", AUTO, raising=False)
    with pytest.raises(ValueError, match="give it hydrodynamics = 'networks'"):
        _with_experiment(of_experiment, replace(AUTO, hydrodynamics="networks"))
    assert of_experiment.experiment is AUTO


VALUES = {
    "hull.mass": 5000, "water.density": 2000.0, "hull.inertia": [1, 2.0, (3, 4.0)], "hydrodynamics.member": 2,
    "soil": "LETE sand", "hydrodynamics": "auto",
}  # fmt: skip


def test_unusual_reaches_into_lists_and_leaves_counts_alone():
    marked = _marked(AUTO, VALUES)
    assert marked == VALUES
    inertia = marked["hull.inertia"]
    parts = [marked["hull.mass"], marked["water.density"], *inertia[:2], *inertia[2]]
    assert all(isinstance(part, Unusual) for part in parts)
    assert type(inertia) is list and type(inertia[2]) is tuple
    assert type(marked["hydrodynamics.member"]) is int


def test_unusual_study_with_numbers_of_networks(tmp_path):
    file = tmp_path / "study.toml"
    file.write_text(
        'unusual = true\n[vary]\n"hydrodynamics.member" = [0, 1]\n"hull.inertia" = [[1, 2, 3], [2, 3, 4]]\n'
    )
    _, cases = read_study(file)
    assert [type(case["hydrodynamics.member"]) for case in cases] == [int] * 4
    assert all(isinstance(part, Unusual) for case in cases for part in case["hull.inertia"])


def test_the_study_that_is_shown_can_be_read(tmp_path):
    text = "\n".join(line for line in str(study.__doc__).splitlines()[2:] if not line.startswith("vehicle"))
    (tmp_path / "study.toml").write_text(text)
    assert len(read_study(tmp_path / "study.toml")[1]) == 15 * 64


# -- cases beyond their time limit -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "ended, status", [(None, "out of time"), ("before", "completed"), ("while killed", "completed")]
)
def test_the_row_of_a_case_that_just_ended_is_kept(ended, status, tmp_path, monkeypatch):
    store = CaseStore(tmp_path / "sweep", of_experiment, [{"hull.mass": 45.0}], 1.0, False)
    store.prepare([])
    monkeypatch.setattr(processes, "GRACE", -2.0)
    monkeypatch.setattr(processes, "lives", lambda pid: True)
    end = lambda *_: store.end(0, "completed", "", 0.1, {"y": 45.0})  # noqa: E731
    monkeypatch.setattr(processes, "_kill_process", end if ended == "while killed" else lambda pid: None)
    store.begin(0, mpi=False)
    mark = (tmp_path / "sweep" / "begun" / "0.json").read_bytes()
    if ended == "before":
        end()
        (tmp_path / "sweep" / "begun" / "0.json").write_bytes(mark)
    assert processes._lost(store, 0.0) == (set() if ended == "before" else {0})
    assert store.read(0)["status"] == status


def test_a_process_that_is_gone_is_noticed_though_its_case_has_ended(tmp_path, monkeypatch):
    """The pool would wait for it for ever."""
    store = CaseStore(tmp_path / "sweep", of_experiment, [{"hull.mass": 45.0}], None, False)
    store.prepare([])
    store.begin(0, mpi=False)
    mark = (tmp_path / "sweep" / "begun" / "0.json").read_bytes()
    store.end(0, "completed", "", 0.1, {"y": 45.0})
    (tmp_path / "sweep" / "begun" / "0.json").write_bytes(mark)
    monkeypatch.setattr(processes, "lives", lambda pid: False)
    assert processes._lost(store, 0.0) == {0}
    assert store.read(0)["status"] == "completed"


def test_an_experiment_over_terrain():
    """Its water by a level: the names are those of a level, and what needs one depth says so; the run gets it all."""
    ground, start = Terrain.slope(0.1), StartPose(1.0, 2.0, 0.3)
    over = replace(amphibious_lane_change(), water=Water(level=0.2), terrain=ground, start=start)
    assert {"water.level", "water.current_speed"} <= set(over.names())
    assert not {"water.depth", "water.depth_ratio", "water.field"} & set(over.names())
    assert over.with_values({"water.level": 0.3}).water == Water(level=0.3)
    for name in ("water.depth", "water.depth_ratio"):
        with pytest.raises(ValueError, match=r"given by its level.*one depth"):
            over.with_values({name: 0.3})
    described = over.description(CoefficientHydrodynamics())
    assert (described.terrain, described.start) == (ground, start)
    assert "water a level over terrain" in str(trust_of_sweep(over, [{}])["trust"])
