"""The camera of a run is what was asked for, wherever its actions are executed."""

import math
from pathlib import Path
from typing import Literal

import pytest
from pydantic import ValidationError

from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.evaluation.run.settings import SimulatorSettings
from evonav.submission.file import About
from evonav.submission.pack import pack
from evonav.submission.packed_setup import packed_setup
from evonav.submission.verify import verify
from evonav.tasks.listing import BUNDLED_TASKS, task_files


def test_a_header_names_the_style_and_what_is_unusual_of_the_camera() -> None:
    wide = SimulatorSettings(hfov_deg=120.0, width_px=400)
    assert wide.component().options == {"style": "default", "hfov_deg": 120.0, "width_px": 400}
    assert wide.model_copy(update={"style": "plain"}).component().options["style"] == "plain"
    assert SimulatorSettings(hfov_deg=90.0, height_px=300).component() == SimulatorSettings().component()


@pytest.mark.parametrize("kind", ["embedded", "ai2thor"])
def test_the_camera_of_a_run_is_what_was_asked_for(kind: Literal["embedded", "ai2thor"]) -> None:
    config = SimulatorSettings(kind=kind, hfov_deg=120.0, width_px=400, height_px=200).component().create().config
    assert (config.width_px, config.height_px) == (400, 200)
    assert config.intrinsics.focal_px == pytest.approx(200.0 / math.tan(math.radians(60.0)))
    with pytest.raises(ValidationError, match="hfov_deg"):
        SimulatorSettings(kind=kind, hfov_deg=170.0)


def test_a_run_with_another_camera_is_scored_again_with_it(tmp_path: Path) -> None:
    tasks = task_files(BUNDLED_TASKS, 1)
    backend = Backend(simulator=SimulatorSettings(hfov_deg=120.0, width_px=400).component())
    evaluate(["fu"], tasks, tmp_path / "wide", config=RunConfig(backend=backend), num_workers=0)
    pack(tmp_path / "wide", tmp_path / "wide.zip", about=About())
    verdict = verify(tmp_path / "wide.zip", tasks)
    assert verdict.is_accepted, verdict.checks
    assert verdict.submission is not None
    assert packed_setup(verdict.submission).simulator.endswith(":embedded_simulator,width_px=400,hfov_deg=120.0")
