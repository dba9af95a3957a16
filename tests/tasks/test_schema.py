import json
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from test_dataset import entries_of, record_of
from test_manifest import mutations
from typer.testing import CliRunner

from evonav.cli import app
from evonav.errors import TaskError
from evonav.tasks import Task
from evonav.tasks.dataset import write_dataset
from evonav.tasks.schema import MODELS, schema_of, write_schemas


def validator_of(name: str) -> jsonschema.Draft202012Validator:
    schema = schema_of(name)
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def kind_of(path: Path) -> str:
    return {"public": "public_stage", "oracle": "oracle_stage"}.get(path.parent.name, path.stem)


def test_every_bundled_file_is_valid() -> None:
    validators = {name: validator_of(name) for name in MODELS}
    num_files = 0
    with as_file(files("evonav") / "data" / "tasks") as folder:
        for path in sorted(folder.rglob("*.json")):
            validators[kind_of(path)].validate(json.loads(path.read_text(encoding="utf-8")))
            num_files += 1
    assert num_files > 200


def test_a_data_set_s_record_is_valid(tmp_path: Path) -> None:
    path = write_dataset(record_of(entries_of(3)), tmp_path)
    validator_of("dataset").validate(json.loads(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize("name", ["task.json", "public/stage_1.json", "oracle/stage_2.json"])
def test_the_schema_refuses_what_the_records_refuse(root: Path, name: str) -> None:
    """Every single change to a file: either both take it or both refuse it, but for what JSON has not."""
    document = json.loads((root / name).read_text(encoding="utf-8"))
    kind = kind_of(Path(name))
    validator, model = validator_of(kind), MODELS[kind]
    verdicts = set()
    for place, wrong in mutations(document):
        text = json.dumps(wrong)
        if 400 * "0" in text:
            continue
        if "NaN" in text or "Infinity" in text:
            with pytest.raises(ValueError, match="validation error"):
                model.model_validate_json(text)
            continue
        is_valid = validator.is_valid(wrong)
        try:
            model.model_validate_json(text)
        except ValueError:
            assert not is_valid, place
        else:
            assert is_valid, place
        verdicts.add(is_valid)
    assert verdicts == {True, False}


def test_unknown_keys_are_refused_at_every_depth(task: Task) -> None:
    def objects_of(value: Any) -> int:
        if isinstance(value, dict):
            closed = value.get("type") != "object" or "additionalProperties" in value
            assert closed, value
            return (value.get("type") == "object") + sum(objects_of(part) for part in value.values())
        return sum(map(objects_of, value)) if isinstance(value, list) else 0

    assert sum(objects_of(schema_of(name)) for name in MODELS) > 20


def test_fields_are_described() -> None:
    schema = schema_of("oracle_stage")
    assert "shortest path" in schema["properties"]["reference_path_m"]["description"].lower()
    assert "2 in the house" in schema["$defs"]["Target"]["properties"]["score"]["description"]


def test_the_command_prints_and_writes(tmp_path: Path) -> None:
    printed = CliRunner().invoke(app, ["tasks", "schema", "task"])
    assert json.loads(printed.output) == schema_of("task")
    written = CliRunner().invoke(app, ["tasks", "schema", "--out", str(tmp_path)])
    assert written.exit_code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"{name}.schema.json" for name in sorted(MODELS)]
    with pytest.raises(TaskError, match="expected one of"):
        schema_of("nothing")
    (tmp_path / "file").touch()
    with pytest.raises(TaskError, match="cannot be written"):
        write_schemas(tmp_path / "file")
