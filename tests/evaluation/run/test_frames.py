"""Few layers lie between the command and an agent."""

import sys
import traceback
from pathlib import Path

import pytest

import evonav
from evonav.agents.frontier_update.agent import FrontierUpdate
from evonav.cli import main

MAX_FRAMES = 12
PACKAGE = str(Path(evonav.__file__).parent)


def test_few_functions_lie_between_the_command_and_an_agent(tmp_path, monkeypatch):
    frames = []

    def act(*_):
        stack = traceback.extract_stack()[:-1]
        frames.extend(f"{frame.filename}:{frame.name}" for frame in stack if frame.filename.startswith(PACKAGE))
        raise KeyboardInterrupt

    monkeypatch.setattr(FrontierUpdate, "act", act)
    options = ["--agent", "fu", "--limit", "1", "--workers", "0", "--out", str(tmp_path / "run")]
    monkeypatch.setattr(sys, "argv", ["evonav", "evaluate", *options])
    with pytest.raises(SystemExit):
        main()
    assert frames[0].endswith("main")
    assert len(frames) <= MAX_FRAMES, "\n".join(frames)
