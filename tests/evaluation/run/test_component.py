"""Components are built from import paths, and run headers keep the form of earlier versions."""

import pytest

from evonav.component import Component, import_callable
from evonav.errors import InvalidArgumentError
from evonav.evaluation.hosting.isolation import AgentHosting
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.worker import SETUPS, WorkerSetup

PARTS = Backend(
    simulator=Component("a.b:make", {"quality": 1}, {"gpu_device": 0}),
    decision=Component("c:model", {"request": {"seed": 3}}),
)
HEADER = {
    "tasks": "evonav.evaluation.run.components:load_spec",
    "simulator": "a.b:make",
    "simulator_options": {"quality": 1},
    "perception": "evonav.perception.ground_truth:GroundTruthPerception",
    "decision": "c:model",
    "decision_options": {"request": {"seed": 3}},
}


def test_a_component_is_created_with_all_its_options() -> None:
    component: Component[dict[str, int]] = Component("builtins:dict", {"a": 1}, {"b": 2})
    assert component.create([("d", 0)], c=3) == {"a": 1, "b": 2, "c": 3, "d": 0}


def test_headers_keep_their_form_and_leave_out_host_options() -> None:
    assert PARTS.identity() == HEADER
    assert Backend.from_identity(HEADER).identity() == HEADER
    assert not Backend.from_identity(HEADER).simulator.host_options


def test_a_header_with_an_unknown_entry_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown entries"):
        Backend.from_identity({**HEADER, "planner": "d:e"})


def test_workers_get_host_options_too() -> None:
    setup = WorkerSetup(PARTS, ProtocolConfig(), AgentHosting(), num_retries=1)
    assert SETUPS.validate_json(SETUPS.dump_json((setup,))) == (setup,)


def test_an_import_error_names_the_path() -> None:
    with pytest.raises(InvalidArgumentError, match="agent `no_such:thing` cannot be imported: ModuleNotFoundError"):
        import_callable("no_such:thing", "agent")
    with pytest.raises(InvalidArgumentError, match="`math:pi` is not callable"):
        import_callable("math:pi")
