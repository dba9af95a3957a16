"""`evonav.evaluate` takes what a person has in hand, and `evonav.Run` shows what came of it."""

from pathlib import Path

import pytest

import evonav
from evonav import Action, Agent, Move, Stop
from evonav.agents.baselines import RandomWalk
from evonav.errors import InvalidArgumentError, StoreError, TaskError


class Walker(Agent):
    """Walks ahead for some rounds."""

    def __init__(self, num_rounds: int = 2) -> None:
        self.num_rounds = num_rounds

    def begin_stage(self, goal: evonav.Goal) -> None:
        self.left = self.num_rounds

    def act(self, observation: evonav.Observation) -> Move | Stop:
        self.left -= 1
        return Move(Action.MOVE_FORWARD) if self.left >= 0 else Stop()


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> evonav.Run:
    class Local(Walker):
        """A class that no other process can import."""

    out = tmp_path_factory.mktemp("api") / "run"
    return evonav.evaluate(Local, "stay-still", [RandomWalk], limit=1, out=out, workers=0)


def test_agents_are_recorded_by_the_name_of_their_class(run: evonav.Run) -> None:
    assert run.agents == ("Local", "evonav.agents.baselines:RandomWalk", "stay-still")
    assert len(run.stages["success"]) == 3 * 4
    assert max(value for name, value in zip(run.rounds["agent"], run.rounds["round"], strict=True) if name == "Local")
    assert repr(run) == f"Run({str(run.path)!r}, agents=['Local', 'evonav.agents.baselines:RandomWalk', 'stay-still'])"


def test_a_local_class_needs_no_workers_and_lambdas_have_the_class_s_name() -> None:
    found = evonav.evaluate(lambda: Walker(1), limit=1)
    assert found.agents == ("Walker",)
    with pytest.raises(InvalidArgumentError, match="worker processes cannot import `Walker`; define it in a module"):
        evonav.evaluate(lambda: Walker(1), limit=1, workers=2)
    with pytest.raises(InvalidArgumentError, match="two agents are called `Walker`"):
        evonav.evaluate(lambda: Walker(1), lambda: Walker(2))


def test_the_same_folder_resumes(run: evonav.Run, tmp_path: Path) -> None:
    class Counted(Walker):
        num_made = 0

        def __init__(self) -> None:
            super().__init__()
            Counted.num_made += 1

    evonav.evaluate(Counted, limit=1, out=tmp_path / "run")
    num_made = Counted.num_made
    again = evonav.evaluate("stay-still", Counted, limit=1, out=str(tmp_path / "run"))
    assert again.agents == ("Counted", "stay-still")
    assert Counted.num_made == num_made > 0
    with pytest.raises(StoreError, match="seed"):
        evonav.evaluate("stay-still", limit=1, out=run.path, seed=1, workers=0)


def test_a_run_shows_tables_and_pages(run: evonav.Run, tmp_path: Path) -> None:
    assert [row[0] for row in run.summary().rows] == list(run.agents)
    assert "stay-still" in repr(run.summary())
    assert "<td>stay-still</td>" in run._repr_html_()
    assert run.report(tmp_path).read_text().startswith("<!doctype html>")
    page = run.view("Local")
    assert page.name.endswith("Local.html")
    assert page.is_file()
    assert evonav.load_run(run.path).agents == run.agents
    assert evonav.load_run(run.path / "records.sqlite").path == run.path


def test_two_agents_are_compared_by_class_name(run: evonav.Run) -> None:
    found = run.compare("RandomWalk", "stay-still")
    assert found.title == "RandomWalk minus stay-still, n = 4"
    spl = dict(zip(found.columns, found.rows[1], strict=True))
    less = float(spl["RandomWalk"]) - float(spl["stay-still"])
    assert float(spl["difference [95% CI]"].split(" ")[0]) == pytest.approx(less, abs=0.1)
    with pytest.raises(InvalidArgumentError, match="no agent 'Locale'; did you mean `Local`"):
        run.compare("Locale", "RandomWalk")
    with pytest.raises(InvalidArgumentError, match="compared with itself"):
        run.compare("RandomWalk", "evonav.agents.baselines:RandomWalk")
    with pytest.raises(InvalidArgumentError, match="the run has no task 'x'"):
        run.view(task="x")


@pytest.mark.parametrize(
    ("agents", "options", "words"),
    [
        ((Walker(),), {}, "an object of `Walker` was given: give the class, `Walker`"),
        (("ftuu",), {}, "did you mean `ftu`"),
        ((dict,), {}, "the class has no method `act`"),
        ((3,), {}, "give a name, a class, or a function"),
        ((), {}, "no agent to evaluate"),
        (("fu",), {"tasks": 5}, "expected `bundled`, a folder of tasks, a task, or a list"),
        (("fu",), {"worker": 2}, "evaluate: worker is no such key; did you mean workers"),
        (("fu",), {"perception": "nois"}, "did you mean noisy"),
        (("fu",), {"decision": {"kin": "text"}}, "decision: kin is no such key; did you mean kind"),
        (("fu",), {"decision": 5}, "decision = 5: expected a word, or a dictionary"),
        (("fu",), {"stage_timeout_s": -1.0}, "stage_timeout_s = -1.0"),
    ],
)
def test_a_wrong_argument_names_the_right_one(agents, options, words) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InvalidArgumentError, match=words):
        evonav.evaluate(*agents, **options)


def test_an_agent_that_needs_arguments_is_told_before_the_run() -> None:
    class Needy(Walker):
        def __init__(self, reach_m: float) -> None:
            super().__init__()

    with pytest.raises(InvalidArgumentError, match=r"`Needy` needs the argument `reach_m`: .* `lambda: Needy"):
        evonav.evaluate(Needy)


def test_missing_folders_are_told(tmp_path: Path) -> None:
    with pytest.raises(TaskError, match=r"nowhere: no such folder of tasks; `bundled` names those of evonav"):
        evonav.evaluate("fu", tasks=tmp_path / "nowhere")
    with pytest.raises(TaskError, match="holds no task"):
        evonav.evaluate("fu", tasks=tmp_path)
    with pytest.raises(StoreError, match="there is no such folder"):
        evonav.load_run(tmp_path / "nowhere")
    with pytest.raises(StoreError, match="no run here"):
        evonav.load_run(tmp_path)
