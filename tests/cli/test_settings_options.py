"""Options of commands come from the models that validate sweep files: same fields, same descriptions, same errors."""

import subprocess
import sys

import pytest
from typer.main import get_command
from typer.testing import CliRunner

from evonav.cli import app
from evonav.cli.options.settings import settings_options
from evonav.errors import InvalidArgumentError
from evonav.sweeps.file import read_sweep
from evonav.tasks.records import descriptions

GROUPS = ("simulation", "perception", "decisions", "spending", "run")


@pytest.mark.parametrize("name", GROUPS)
def test_every_field_is_an_option_with_its_description(name):
    group = get_command(app)
    _, command, _ = group.resolve_command(group.make_context("evonav", ["evaluate"]), ["evaluate", "--help"])
    found = {parameter.name: parameter for parameter in command.params}
    options = settings_options(name)
    assert options.chosen
    for field in options.chosen:
        description = descriptions(options.model)[field]
        assert found[options.option(field)].help == " ".join(description.split())


@pytest.mark.parametrize(
    ("options", "table", "problem"),
    [
        (("--thor-gpu", "0"), "simulators.a = {gpu_device = 0}", "is for simulator ai2thor"),
        (("--max-cost", "0.0"), "max_cost = 0.0", "= 0.0: Input should be greater than 0"),
        (("--ray-address", "auto"), 'ray_address = "auto"', "is for engine ray"),
        (("--device", "cpu"), 'perceptions.a = {device = "cpu"}', "is for perception predicted"),
        (("--temperature", "0.5"), "decisions.a = {temperature = 0.5}", "is of no use where text decides"),
    ],
)
def test_commands_and_sweep_files_refuse_a_setting_in_the_same_words(tmp_path, options, table, problem):
    shown = CliRunner().invoke(app, ["evaluate", *options, "--out", str(tmp_path / "out")], env={"COLUMNS": "160"})
    assert shown.exit_code == 2
    assert f"{options[-2]} {problem}" in shown.output
    path = tmp_path / "sweep.toml"
    path.write_text(f'agents = "fu"\ntasks = "bundled:1"\n{table}\n')
    with pytest.raises(InvalidArgumentError, match=problem):
        read_sweep(path)


def test_models_are_loaded_only_for_the_command_that_is_called():
    code = "import sys; from evonav.cli import app\ntry: app(['agents'])\nexcept SystemExit: pass\n"
    code += "print([name for name in sys.modules if name.startswith('evonav.evaluation.run')])"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.splitlines()[-1] == "[]"
