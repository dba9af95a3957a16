"""What a new user does wrong, and the sentence that says what to do: no traceback, no empty answer."""

import shutil
import sys

import pytest

from evonav.cli import main
from evonav.evaluation.records.store import RunStore
from evonav.tasks.listing import BUNDLED_TASKS

ONE = "--agent shortest-path --limit 1 --workers 0"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run, a sweep, a run that has not begun, tasks without a dataset.json, an empty folder and a file."""
    place = tmp_path_factory.mktemp("mistakes")
    (place / "empty").mkdir()
    (place / "file").write_text("x")
    (place / "sweep.toml").write_text('agents = "shortest-path"\ntasks = "bundled:1"\nworkers = 0\n')
    (place / "typo.toml").write_text('agents = "fu"\ntask = "bundled:1"\n')
    one = min(path for path in BUNDLED_TASKS.iterdir() if (path / "task.json").is_file())
    shutil.copytree(one, place / "tasks" / one.name)
    with RunStore(place / "begun", create=True) as store:
        store.set_meta("agents", ["fu"])
        store.set_meta("num_stages", {"t": 3})
        store.set_meta("config", {"seed": 0, "protocol": {}, "backend": {}})
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        for words in (
            "evaluate --agent shortest-path --limit 1 --workers 0 --out run",
            "sweep sweep.toml --out sweep",
        ):
            patch.setattr(sys, "argv", ["evonav", *words.split()])
            with pytest.raises(SystemExit) as exit_:
                main()
            assert exit_.value.code == 0
    return place


EVALUATE = "evaluate --workers 0 --out out"
MISTAKES = {
    # a command or an option
    "evaluate": "Missing option '--out'",
    "evalaute --out out": "Did you mean 'evaluate'?",
    f"{EVALUATE} --agnets fu": "--agent",
    f"{EVALUATE} --limit none": "'--limit'",
    f"{EVALUATE} --limit 2 --subset test-90": "give --limit or --subset, not both",
    f"{EVALUATE} --set ray_address=auto": "--set ray_address is for engine ray",
    f"{EVALUATE} --set temperature=0.5": "did you mean decision.temperature?",
    f"{EVALUATE} --set decision.temprature=0.5": "did you mean decision.temperature?",
    f"{EVALUATE} --set workers": "--set workers: expected KEY=VALUE",
    f"{EVALUATE} --set num_retries=-1": "--set num_retries = -1: Input should be greater than or equal to 0",
    "check-agent fu --set simulator.width_px=64": "is no such key; `--set help` lists the keys",
    # an agent
    f"{EVALUATE} --agent ftuu": "did you mean `ftu`?",
    f"{EVALUATE} --agent fu --agent fu": "an agent is named twice: fu, fu",
    f"{EVALUATE} --agent ./agent.py": "such as `./agent.py:MyAgent`",
    f"{EVALUATE} --agent ./agent.py:Agent": "no file ./agent.py",
    # tasks and houses
    f"{EVALUATE} --tasks nowhere": "there is no such folder; `evonav tasks generate` makes one",
    f"{EVALUATE} --tasks empty": "expected */task.json",
    f"{EVALUATE} --tasks file": "it is a file: name a folder of tasks",
    f"{EVALUATE} --tasks tasks/ONE": "is a task itself: name the folder that holds it, tasks",
    f"{EVALUATE} --tasks tasks --subset test-90": "has no dataset.json, which `evonav tasks generate` writes",
    f"{EVALUATE} --tasks tasks --subset test90": "expected SPLIT-N, such as test-90",
    f"{EVALUATE} --houses nowhere.json": "nowhere.json: cannot be read: no such file",
    f"{EVALUATE} --houses procthor-10k:test": "evonav houses fetch procthor-10k",
    f"{EVALUATE} --houses procthor-10k:tset": "one of train, val, test",
    # a folder
    f"evaluate {ONE} --seed 1 --out run": "use another folder",
    f"evaluate {ONE} --out file": "File exists; name another folder",
    "report nowhere": "there is no such folder); `evonav evaluate --out nowhere` makes one",
    "report empty": "no run here (records.sqlite not found)",
    "paper sweep": "name one, such as sweep/runs/gt__text__bundled-1__s0",
    "view begun": "nothing was run yet: `evonav evaluate` goes on",
    "view run --agent fu": "it has some of shortest-path",
    "view run --task bundled": "there is ONE",
    "paper begun": "no stage is scored yet",
    "compare run fu ftu": "it has shortest-path",
    # a model
    f"{EVALUATE} --decision vlm": "--model is needed to ask a model (or EVONAV_VLM_MODEL",
    f"{EVALUATE} --decision vlm --model gpt-4o": "set OPENAI_API_KEY",
    f"{EVALUATE} --decision gpt-4o": "expected text, looks, vlm or module:name",
    f"{EVALUATE} --model gpt-4o --set decision.top_p=1": "--set decision.top_p is of no use where text decides",
    "evaluate --out new --decision vlm --model m --set decision.mode=replay": "no exchanges here to replay",
    f"{EVALUATE} --set decision.noise.wrong=often": "decision.noise.wrong = 'often': Input should be a valid number",
    # a sweep
    "sweep": "name a sweep file",
    "sweep nowhere.toml": "nowhere.toml: cannot be read: No such file",
    "sweep sweep.toml --set agents=ftuu --dry-run": "did you mean `ftu`?",
    "sweep typo.toml": "typo.toml: task is no such key; did you mean tasks?",
    "sweep sweep.toml --only nothing": "fits no cell; there are gt__text__bundled-1__s0",
    "sweep sweep.toml --out sweep --set seeds=4": "sweep holds another sweep",
}


def told(monkeypatch, capsys, words):
    monkeypatch.setattr(sys, "argv", ["evonav", *words.split()])
    with pytest.raises(SystemExit) as exit_:
        main()
    error = " ".join(capsys.readouterr().err.replace("│", " ").split())
    return exit_.value.code, error


@pytest.mark.parametrize("words", MISTAKES)
def test_a_mistake_is_told_with_what_to_do(folder, monkeypatch, capsys, tmp_path, words):
    for name in ("OPENAI_API_KEY", "OPENAI_BASE_URL", "EVONAV_VLM_MODEL", "EVONAV_DEBUG"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("EVONAV_CACHE", str(tmp_path))
    monkeypatch.chdir(folder)
    one = next((folder / "tasks").iterdir()).name
    code, error = told(monkeypatch, capsys, words.replace("ONE", one))
    assert code in (1, 2)
    assert MISTAKES[words].replace("ONE", one) in error
    assert "Traceback" not in error


@pytest.mark.parametrize(
    ("words", "module", "extra"),
    [
        (f"{EVALUATE} --decision vlm --model m --base-url http://127.0.0.1:9/v1", "openai", "vlm"),
        (f"{EVALUATE} --simulator ai2thor", "ai2thor", "thor"),
        ("evaluate --workers 1 --limit 1 --agent fu --out out-ray --set engine=ray", "ray", "ray"),
    ],
)
def test_an_extra_that_is_not_installed_is_named(folder, monkeypatch, capsys, words, module, extra):
    monkeypatch.chdir(folder)
    for name in [name for name in sys.modules if name.partition(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    code, error = told(monkeypatch, capsys, words)
    assert code == 1
    assert f"evonav[{extra}]" in error


def test_the_traceback_is_there_when_it_is_asked_for(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    monkeypatch.delenv("EVONAV_DEBUG", raising=False)
    from evonav.errors import StoreError

    monkeypatch.setenv("EVONAV_DEBUG", "")  # so that what the option sets ends with the test
    monkeypatch.setattr(sys, "argv", ["evonav", "--debug", "report", "empty"])
    with pytest.raises(StoreError):
        main()
    monkeypatch.setenv("EVONAV_DEBUG", "1")
    monkeypatch.setattr(sys, "argv", ["evonav", "report", "empty"])
    with pytest.raises(StoreError):
        main()
    monkeypatch.setenv("EVONAV_DEBUG", "0")
    assert told(monkeypatch, capsys, "report empty")[0] == 1
