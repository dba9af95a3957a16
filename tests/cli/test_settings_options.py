"""`--set` has the keys of sweep files, with the same descriptions and errors."""

import subprocess
import sys

import pytest
from typer.main import get_command
from typer.testing import CliRunner

from evonav.cli import app
from evonav.cli.options.settings import FLAGS, setting_keys
from evonav.errors import InvalidArgumentError
from evonav.sweeps.file import read_sweep


def shown(*words):
    return CliRunner().invoke(app, ["evaluate", *words], env={"COLUMNS": "160"})


def test_every_key_without_an_option_is_listed_with_its_description():
    printed = " ".join(shown("--set", "help").stdout.split())
    assert "decision.temperature VLM: sampling temperature. Default: 0.7." in printed
    assert all(f"{key} " in printed for key in setting_keys() if key not in FLAGS)
    assert "decision.model " not in printed, "it has an option"


def test_every_option_of_a_setting_names_a_key():
    command = get_command(app).commands["evaluate"]
    options = {option for parameter in command.params for option in parameter.opts}
    assert set(FLAGS) <= set(setting_keys())
    assert set(FLAGS.values()) <= options


def test_the_shell_completes_keys():
    (parameter,) = (one for one in get_command(app).commands["evaluate"].params if one.name == "set_")
    context = get_command(app).make_context("evonav", ["agents"])
    found = [one.value for one in parameter.shell_complete(context, "decision.t")]
    assert found == [
        "decision.temperature=",
        "decision.top_p=",
        "decision.tokens_per_minute=",
        "decision.tell_of_change=",
    ]


@pytest.mark.parametrize(
    ("options", "table", "problem"),
    [
        (("--set", "simulator.gpu_device=0"), "simulators.a = {gpu_device = 0}", "is for simulator ai2thor"),
        (("--max-cost", "0.0"), "max_cost = 0.0", "= 0.0: Input should be greater than 0"),
        (("--set", "ray_address=auto"), 'ray_address = "auto"', "is for engine ray"),
        (("--set", "perception.device=cpu"), 'perceptions.a = {device = "cpu"}', "is for perception predicted"),
        (("--set", "decision.temperature=0.5"), "decisions.a = {temperature = 0.5}", "is of no use where text decides"),
    ],
)
def test_commands_and_sweep_files_refuse_a_setting_in_the_same_words(tmp_path, options, table, problem):
    told = shown(*options, "--out", str(tmp_path / "out"))
    assert told.exit_code == 2
    assert f"{' '.join(options).partition('=')[0].removesuffix(' 0.0')} {problem}" in told.output
    path = tmp_path / "sweep.toml"
    path.write_text(f'agents = "fu"\ntasks = "bundled:1"\n{table}\n')
    with pytest.raises(InvalidArgumentError, match=problem):
        read_sweep(path)


def test_models_are_loaded_only_for_the_command_that_is_called():
    code = "import sys; from evonav.cli import app\ntry: app(['agents'])\nexcept SystemExit: pass\n"
    code += "print([name for name in sys.modules if name.startswith('evonav.evaluation.run')])"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.splitlines()[-1] == "[]"
