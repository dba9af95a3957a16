"""A run that is resumed keeps the style in which it was begun."""

import pytest

from evonav.evaluation.run.settings import SimulatorSettings
from evonav.world.simulator import SimulatorConfig


@pytest.mark.parametrize("options", [{}, {"simulator_options": {"style": "outlined"}}])
def test_a_resumed_run_keeps_the_style_that_its_header_means(options: dict[str, object]) -> None:
    path = SimulatorSettings().component().path
    recorded = {"simulator": path, **options}
    for said in (SimulatorSettings(), SimulatorSettings(style="outlined")):
        assert said.component(recorded).identity("simulator") == recorded
        assert said.component(recorded).create().config.style == "outlined"
    lit = {"simulator": path, "simulator_options": {"style": "default"}}
    assert SimulatorSettings().component(lit).identity("simulator") == lit
    assert SimulatorSettings(style="default").component(recorded).options == {"style": "default"}
    assert SimulatorSettings().component().create().config.style == SimulatorConfig().style
