"""Sweep files: what they may say, what is refused and in which words, and what cells they make."""

from pathlib import Path

import jsonschema
import pytest

from evonav.errors import InvalidArgumentError
from evonav.sweeps.file import read_sweep, sweep_schema
from evonav.sweeps.run import cells_of, chosen
from evonav.toml import read_toml

EXAMPLES = Path(__file__).parents[2] / "examples" / "sweeps"
SMALL = 'agents = ["fu"]\ntasks = ["bundled:2"]\n'


def write(tmp_path, text, name="sweep.toml"):
    path = tmp_path / name
    path.write_text(text)
    return path


def names(path, *changes):
    return [cell.name for cell in cells_of(read_sweep(path, changes))]


def test_short_forms_and_tables_give_the_same_sweep(tmp_path):
    short = """
agents = ["fu", "ftu"]
tasks = ["bundled:2"]
seeds = [0, 1]
[decisions]
right = "text"
wrong = {noise = {wrong = 0.1}}
[[exclude]]
agent = "ftu"
decision = "wrong"
"""
    long = """
agents = "fu, ftu"
tasks.bundled-2 = {folder = "bundled", limit = 2}
seeds = [0, 1]
exclude = [{agent = ["ftu"], decision = "wr*"}]
[decisions]
right = {}
wrong = {kind = "text", noise = {wrong = 0.1}}
"""
    first = read_sweep(write(tmp_path, short))
    assert cells_of(first) == cells_of(read_sweep(write(tmp_path, long)))
    assert [(cell.name, cell.agents) for cell in cells_of(first)] == [
        ("gt__right__bundled-2__s0", ("fu", "ftu")),
        ("gt__right__bundled-2__s1", ("fu", "ftu")),
        ("gt__wrong__bundled-2__s0", ("fu",)),
        ("gt__wrong__bundled-2__s1", ("fu",)),
    ]


def test_a_cells_name_depends_on_nothing_but_the_cell(tmp_path):
    path = write(tmp_path, SMALL)
    assert names(path) == ["gt__text__bundled-2__s0"]
    more = names(path, 'decisions=["text","text:lost=0.5","vlm:org/model"]', "seeds=0,7", 'agents=["ftu","fu"]')
    assert "gt__text__bundled-2__s0" in more
    assert len(more) == 6
    assert names(path, "simulators=ai2thor") == ["ai2thor__gt__text__bundled-2__s0"]
    assert "gt__org-model__bundled-2__s7" in more


def test_include_keeps_and_exclude_takes_away(tmp_path):
    path = write(
        tmp_path,
        'agents = ["fu", "ftu", "3d-mem"]\ntasks = ["bundled:2", "bundled:3"]\nseeds = [0, 1]\n'
        'include = [{tasks = "bundled-2"}, {agent = "3d-mem", seed = 1}]\nexclude = [{seed = 0, agent = "f*"}]\n',
    )
    assert [(cell.name, cell.agents) for cell in cells_of(read_sweep(path))] == [
        ("gt__text__bundled-2__s0", ("3d-mem",)),
        ("gt__text__bundled-2__s1", ("fu", "ftu", "3d-mem")),
        ("gt__text__bundled-3__s1", ("3d-mem",)),
    ]
    assert [cell.name for cell in chosen(cells_of(read_sweep(path)), ["*3__s1", "*s0"])] == [
        "gt__text__bundled-2__s0",
        "gt__text__bundled-3__s1",
    ]


def test_what_is_set_goes_before_the_file(tmp_path):
    path = write(tmp_path, SMALL + '[protocol]\nmax_rounds = 5\n[decisions.gpt]\nkind = "vlm"\nmodel = "gpt-4o"\n')
    sweep = read_sweep(path, ["protocol.max_rounds=7", "decisions.gpt.temperature=0", "agents=ftu,fu", "workers=3"])
    assert sweep.protocol.max_rounds == 7
    assert sweep.protocol.max_views == 7  # the paper's
    assert sweep.decisions["gpt"].temperature == 0.0
    assert (sweep.agents, sweep.workers) == (("ftu", "fu"), 3)


MISTAKES = {
    "no agent": ('tasks = "bundled"', "agents is missing"),
    "no tasks": ('agents = "fu"', "tasks is missing"),
    "empty agents": ('agents = []\ntasks = "bundled"', "agents = []"),
    "agent twice": ('agents = "fu,fu"\ntasks = "bundled"', "agents: 'fu' is named twice"),
    "unknown key": (SMALL + "sedes = [1]", "sedes is no such key; did you mean seeds?"),
    "unknown key, nothing near": (SMALL + "zzz = 1", "zzz is no such key; there are prices, max_cost, workers"),
    "unknown key inside": (
        SMALL + "[protocol]\nmax_round = 3",
        "protocol.max_round is no such key; did you mean protocol.max_rounds?",
    ),
    "unknown decision key": (
        SMALL + '[decisions.a]\nkind = "vlm"\nmodel = "m"\ntemprature = 0.1',
        "decisions.a.temprature is no such key; did you mean decisions.a.temperature?",
    ),
    "wrong type": (SMALL + 'seeds = ["a"]', "seeds.0 = 'a'"),
    "seed of words": (SMALL + 'seeds = "a"', "seeds = 'a': expected whole numbers"),
    "negative seed": (SMALL + "seeds = [-1]", "seeds.0 = -1"),
    "seed twice": (SMALL + "seeds = [1, 1]", "seeds = [1, 1]: a seed is named twice"),
    "no seed": (SMALL + "seeds = []", "seeds = []"),
    "true is no seed": (SMALL + "seeds = [true]", "seeds.0 = True"),
    "bad engine": (SMALL + 'engine = "slurm"', "engine = 'slurm'"),
    "ray address without ray": (SMALL + 'ray_address = "auto"', "ray_address is for engine ray"),
    "bad kind": (SMALL + 'decisions = "gpt4"', "decisions.gpt4.kind gpt4: expected text, looks, vlm or module:name"),
    "no model": (SMALL + '[decisions.a]\nkind = "vlm"', "decisions.a.model is needed"),
    "model setting for rules": (SMALL + "[decisions.a]\ntemperature = 0.5", "decisions.a.temperature is of no use"),
    "sampling out of range": (
        SMALL + '[decisions.a]\nkind = "vlm"\nmodel = "m"\ntemperature = 9.0',
        "decisions.a: temperature",
    ),
    "record": (SMALL + '[decisions.a]\nkind = "vlm"\nmodel = "m"\nmode = "record"', "decisions.a.mode = 'record'"),
    "live keeps nothing": (
        SMALL + '[decisions.a]\nkind = "vlm"\nmodel = "m"\nmode = "live"\nexchanges = "x"',
        "decisions.a.exchanges is of no use with mode live",
    ),
    "unknown noise": (SMALL + 'decisions = ["text:wrnog=0.1"]', "decisions: 'text:wrnog=0.1': wrnog=0.1: expected"),
    "noise out of range": (SMALL + "[decisions.a]\nnoise = {wrong = 2.0}", "decisions.a: noise: wrong"),
    "thor setting for embedded": (SMALL + '[simulators.a]\nexecutable = "x"', "simulators.a.executable is for"),
    "bad simulator": (SMALL + 'simulators = "habitat"', "simulators.habitat.kind = 'habitat'"),
    "bad perception": (
        SMALL + 'perceptions = "yolo"',
        "perceptions.yolo: perception 'yolo': expected gt, noisy[:PRESET]",
    ),
    "bad subset": ('agents = "fu"\ntasks = "x:test90"', "'x:test90': expected FOLDER, FOLDER:LIMIT or FOLDER:SUBSET"),
    "limit and subset": (
        'agents = "fu"\ntasks.a = {folder = "x", limit = 2, subset = "test-9"}',
        "tasks.a: give limit or subset",
    ),
    "limit 0": ('agents = "fu"\ntasks = "bundled:0"', "tasks.bundled-0.limit = 0"),
    "same name": ('agents = "fu"\ntasks = ["a/x", "b/x"]', "both called 'x'"),
    "name of two parts": ('agents = "fu"\ntasks.a__b = "x"', "tasks.a__b is no name: letters"),
    "list of tables": (SMALL + 'decisions = [{kind = "text"}]', "give tables names of their own"),
    "excludes nothing": (
        SMALL + 'exclude = [{agent = "ftu"}]',
        "exclude.0 fits no combination: there is none of agent",
    ),
    "excludes all": (SMALL + 'exclude = [{agent = "fu"}]', "`exclude` leaves nothing"),
    "empty pattern": (SMALL + "exclude = [{}]", "exclude.0 is empty"),
    "pattern of words": (SMALL + 'exclude = ["fu"]', "exclude.0 = 'fu'"),
    "unknown axis": (
        SMALL + 'exclude = [{agents = "fu"}]',
        "exclude.0.agents is no such key; did you mean exclude.0.agent?",
    ),
    "cost without prices": (SMALL + "max_cost = 3.0", "max_cost = 3 needs prices"),
    "no money": (SMALL + 'prices = "p"\nmax_cost = 0.0', "max_cost = 0"),
    "infinite": (SMALL + "max_cost = inf", "no text, number, list or table"),
    "a date": (SMALL + "name = 2020-01-01", "no text, number, list or table"),
    "broken": ("agents = [", "not TOML"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_told_in_a_sentence_with_file_and_key(tmp_path, mistake, monkeypatch):
    monkeypatch.delenv("EVONAV_VLM_MODEL", raising=False)
    text, words = MISTAKES[mistake]
    path = write(tmp_path, text)
    with pytest.raises(InvalidArgumentError) as error:
        cells_of(read_sweep(path))
    assert words in str(error.value)
    assert "\n" not in str(error.value)
    if "fits no" not in words and "leaves" not in words:
        assert str(error.value).startswith(str(path))


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.toml", "agents = [fu\n", "not TOML"),
        ("a.toml", 'agents = "fu"\nagents = "ftu"\n', "not TOML: Cannot overwrite a value"),
        ("a.toml", "a = " + "[" * 100_000, "not TOML"),
        ("a.yaml", "agents: fu\n", "expected TOML: write it as TOML, in a file whose name ends in .toml"),
        ("a.json", "{}", "expected TOML"),
    ],
)
def test_a_file_that_cannot_be_read_says_why(tmp_path, name, text, words):
    with pytest.raises(InvalidArgumentError, match=r"a\.\w+: ") as error:
        read_sweep(write(tmp_path, text, name))
    assert words in str(error.value)
    with pytest.raises(InvalidArgumentError, match="cannot be read: No such file"):
        read_sweep(tmp_path / "none.toml")


@pytest.mark.parametrize("change", ["seeds", "=1", "a..b=1", "tasks.x=1"])
def test_a_change_that_is_none_is_refused(tmp_path, change):
    with pytest.raises(InvalidArgumentError, match="--set"):
        read_sweep(write(tmp_path, SMALL), [change])


def test_patterns_for_cells_that_fit_none_are_refused(tmp_path):
    with pytest.raises(InvalidArgumentError, match=r"--only s1: fits no cell; there are gt__text__bundled-2__s0"):
        chosen(cells_of(read_sweep(write(tmp_path, SMALL))), ["s1"])


def test_the_schema_takes_what_the_reader_takes(tmp_path):
    """Editors are to mark what is wrong and nothing else; what only several fields together can tell is left out."""
    schema = sweep_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    for path in sorted(EXAMPLES.glob("*.toml")):
        read_sweep(path)
        validator.validate(read_toml(path))
    for text in (SMALL, 'agents = "fu"\ntasks = "bundled"\nseeds = 3\nexclude = [{seed = 1, agent = ["a"]}]'):
        validator.validate(read_toml(write(tmp_path, text)))
    for name in ("unknown key", "unknown key inside", "wrong type", "negative seed", "bad engine", "no tasks"):
        assert not validator.is_valid(read_toml(write(tmp_path, MISTAKES[name][0]))), name
