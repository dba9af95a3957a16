"""Commands beside `evonav evaluate` that run many episodes at once where a model is waited for."""

from pathlib import Path

import pytest
from toy_run import texts
from typer.testing import CliRunner

from evonav.cli import app
from evonav.controlled.dataset import generate_controlled
from evonav.controlled.layout import ControlledOptions, run_of
from evonav.decision.vlm.mock_answers import mock_answer
from evonav.evaluation.hosting.fork_server import IS_SUPPORTED
from evonav.tasks.parameters import GenerationParameters
from vlm_stub import serving

pytestmark = [
    pytest.mark.skipif(not IS_SUPPORTED, reason="many episodes at once need agents in processes of their own"),
    pytest.mark.slow,
]
SMALL = GenerationParameters(reference_image_px=64, reference_min_visible_px=10)


def run(*words: object) -> int:
    """Runs a command with a model that answers late; returns how many questions the model had at once."""
    with serving(lambda request: {"text": mock_answer(request), "hang_s": 0.1}) as stub:
        model = ["--decision", "vlm", "--model", "m", "--base-url", stub.url, "--set", "decision.images=false"]
        done = CliRunner().invoke(app, [*map(str, words), "--workers", "1", *model])
        assert done.exit_code == 0, done.output
        return stub.most_at_once


def test_both_arms_of_a_controlled_analysis_run_at_once(tmp_path: Path) -> None:
    """A house has an episode in each arm."""
    folders = {at_once: tmp_path / at_once for at_once in ("one", "many")}
    for folder in folders.values():
        generate_controlled("bundled", folder, options=ControlledOptions(parameters=SMALL), limit=1)
    command = ("controlled", "evaluate")
    assert run(*command, folders["one"], "--agent", "fu", "--set", "episodes_at_once=1") == 1
    assert run(*command, folders["many"], "--agent", "fu") == 2  # 16 is the default
    for arm in ("fixed", "evolved"):
        one, many = (run_of(folder, arm) for folder in folders.values())
        assert len(texts(one)) == 6  # three stages with their floor plans
        assert texts(one) == texts(many)
        assert (one / "summary.json").read_bytes() == (many / "summary.json").read_bytes()


@pytest.mark.parametrize("options", [("--workers", "0"), ("--isolation", "none")])
def test_agents_without_processes_cannot_run_at_once(tmp_path: Path, options: tuple[str, str]) -> None:
    generate_controlled("bundled", tmp_path, options=ControlledOptions(parameters=SMALL), limit=1)
    done = CliRunner().invoke(app, ["controlled", "evaluate", str(tmp_path), "--set", "episodes_at_once=2", *options])
    assert done.exit_code == 2
    assert "needs workers, and agents in processes of their own" in " ".join(done.output.replace("│", " ").split())
