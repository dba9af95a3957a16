"""A model's texts in place of the describer's: what is asked, what may stand, and what an interrupted pass leaves."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from generated_folder import record_of

from evonav.decision.vlm.account import Account, Price
from evonav.decision.vlm.caching_client import ResponseCache
from evonav.decision.vlm.client import VlmClient, VlmConfig
from evonav.errors import TaskError
from evonav.generation.instructions import writer
from evonav.generation.instructions.writer import estimate_texts, write_texts
from evonav.tasks import Task, load_tasks, write_task
from evonav.tasks.dataset import check_dataset, entry_of, read_dataset, write_dataset
from vlm_stub import KEY, Stub, images_in, serving


def words_of(request: dict[str, Any]) -> str:
    content = request["messages"][0]["content"]
    assert [part["type"] for part in content] == ["text", "image_url"]
    return str(content[0]["text"])


def writes(request: dict[str, Any]) -> dict[str, str]:
    """Answers as the paper's model might, from what is asked alone."""
    words = words_of(request)
    (image,) = images_in(request)
    basic = re.search(r"^Basic instruction: (.*)$", words, re.MULTILINE)
    assert basic
    if words.startswith(writer.APPEARANCE_PROMPT):
        noun = re.search(r"^Target category: (.*)$", words, re.MULTILINE)
        assert noun
        return {"text": f'"Find the {noun[1]} with a hue of {image.getpixel((0, 0))[0]} out there."'}
    assert words.startswith(writer.UNIFIED_PROMPT)
    appearance = re.search(r"^Appearance instruction: (.*)$", words, re.MULTILINE)
    assert appearance
    return {"text": f"**Unified instruction:** {appearance[1]}\n{basic[1]}"}


@pytest.fixture
def stub() -> Iterator[Stub]:
    with serving(writes) as stub:
        yield stub


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three tasks with a `dataset.json`."""
    with as_file(files("evonav") / "data" / "tasks") as directory:
        tasks = list(load_tasks(directory, 3))
    for task in tasks:
        write_task(task, tmp_path / "tasks")
    record = record_of(tuple(map(entry_of, tasks)), parameters=tasks[0].header.parameters)
    write_dataset(record, tmp_path / "tasks")
    return tmp_path / "tasks"


def client_of(stub: Stub, **options: Any) -> VlmClient:
    return VlmClient(VlmConfig("gpt-4o", base_url=stub.url, api_key=KEY, max_retries=0), **options)


def bytes_of(directory: Path) -> dict[str, bytes]:
    return {str(path.relative_to(directory)): path.read_bytes() for path in directory.rglob("*") if path.is_file()}


def num_stages(tasks: list[Task]) -> int:
    return sum(task.num_stages for task in tasks)


def test_a_text_model_merges_the_describers_texts(folder: Path) -> None:
    before = list(load_tasks(folder))
    asked: list[str] = []

    def merges(request: dict[str, Any]) -> dict[str, str]:
        (part,) = request["messages"][0]["content"]
        assert part["type"] == "text"
        assert "image" not in part["text"]
        asked.append(part["text"])
        return {"text": f"Go there, please, for the {len(asked)}. time."}

    with serving(merges) as stub:
        client = client_of(stub)
        assert estimate_texts(folder, client, images=False).num_questions == num_stages(before)
        writing = write_texts(folder, client, images=False)
        again = write_texts(folder, client, images=False)
    assert writing.num_written == again.num_written_before == num_stages(before) == len(asked)
    for old, new in zip(before, load_tasks(folder), strict=True):
        for was, now in zip(old.public_stages, new.public_stages, strict=True):
            assert now.writer == "vlm:gpt-4o, without images"
            assert now.appearance_instruction == was.appearance_instruction
            assert now.unified_instruction.startswith("Go there, please")
            assert any(was.basic_instruction in text and was.appearance_instruction in text for text in asked)


def test_texts_and_checksums_change_and_nothing_else(stub: Stub, folder: Path) -> None:
    before = list(load_tasks(folder))
    files_before = bytes_of(folder)
    writing = write_texts(folder, client_of(stub))
    after = list(load_tasks(folder))  # checks the checksums
    assert writing.num_written == num_stages(before) == len(stub.requests) / 2
    assert (writing.num_written_before, writing.failures, writing.num_done) == (0, {}, 3)
    for old, new in zip(before, after, strict=True):
        assert new.oracle_stages == old.oracle_stages
        for k, (was, now) in enumerate(zip(old.public_stages, new.public_stages, strict=True)):
            assert now.writer == "vlm:gpt-4o"
            assert now.basic_instruction == was.basic_instruction
            hue = int(new.reference_images[k][0, 0, 0])
            assert now.appearance_instruction.endswith(f"with a hue of {hue} out there.")
            assert now.appearance_instruction.startswith("Find the ")
            assert now.unified_instruction == f"{now.appearance_instruction} {was.basic_instruction}"
            assert np.array_equal(old.reference_images[k], new.reference_images[k])
    files_after = bytes_of(folder)
    changed = {name for name in files_after if files_after[name] != files_before.get(name)}
    assert files_after.keys() == files_before.keys()
    assert {re.sub(r"^[^/]+/|stage_\d", "", name) for name in changed} == {"task.json", "public/.json", "dataset.json"}
    assert not check_dataset(read_dataset(folder), folder)


def test_the_prompts_are_the_papers(stub: Stub, folder: Path) -> None:
    write_texts(folder, client_of(stub), limit=1)
    appearance, unified = (words_of(request) for request in stub.requests[:2])
    assert appearance.startswith(
        "Given the target category, the basic instruction, and the reference image, write one short navigation "
        "instruction that identifies the target mainly by visible appearance, including shape and color first, and "
        "material, texture, size, or distinctive parts when helpful.\nDo not mention coordinates, object IDs, "
        "simulator terms, or invisible attributes.\n\nTarget category: "
    )
    assert unified.startswith(
        "Given the basic instruction, the appearance instruction, and the reference image, write one concise "
        "navigation instruction that combines spatial relations with visual appearance.\nKeep relations such as on, "
        "next to, near, or below only when they are supported by the image.\n\nBasic instruction: Please navigate"
    )
    assert images_in(stub.requests[0])[0].size == (300, 300)


def test_nothing_secret_is_asked(stub: Stub, folder: Path) -> None:
    """Only public facts go out: no id of an object, a room or a task."""
    write_texts(folder, client_of(stub))
    asked = json.dumps([words_of(request) for request in stub.requests])
    for task in load_tasks(folder):
        secrets = {task.task_id, task.header.house.name}
        for stage in task.oracle_stages:
            secrets |= {stage.target.id, stage.target.room_id}
        assert not [secret for secret in secrets if secret in asked]


def test_a_replay_writes_the_same_bytes_without_a_server(stub: Stub, folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    for task in load_tasks(folder):
        write_task(task, copy)
    store = ResponseCache(tmp_path / "exchanges.sqlite")
    write_texts(folder, client_of(stub, store=store))
    num_asked = len(stub.requests)
    config = VlmConfig("gpt-4o", base_url="http://127.0.0.1:9/v1", max_concurrency=1)
    replay = VlmClient(config, store=store, mode="replay")
    assert estimate_texts(copy, replay).num_cached == num_asked / 2  # the second question holds the first answer
    assert write_texts(copy, replay).num_written == num_asked / 2
    (folder / "dataset.json").unlink()
    assert bytes_of(copy) == bytes_of(folder)
    assert len(stub.requests) == num_asked


def test_a_second_pass_asks_nothing(stub: Stub, folder: Path) -> None:
    first = write_texts(folder, client_of(stub), limit=2)
    num_asked = len(stub.requests)
    before = bytes_of(folder)
    again = write_texts(folder, client_of(stub), limit=2)
    assert (again.num_written, again.num_written_before) == (0, first.num_written)
    assert len(stub.requests) == num_asked
    assert bytes_of(folder) == before
    assert write_texts(folder, client_of(stub)).num_written > 0


def test_a_bad_answer_is_asked_for_once_more(stub: Stub, folder: Path) -> None:
    stub.script = [{"text": "Go to (1.0, 2.5), where Mug|surface|3 is."}, {"text": "Find the red mug."}]
    config = VlmConfig("gpt-4o", base_url=stub.url, api_key=KEY, max_concurrency=1)
    writing = write_texts(folder, VlmClient(config), limit=1)
    assert not writing.failures
    (task,) = load_tasks(folder, 1)
    assert task.public_stages[0].appearance_instruction == "Find the red mug."
    asked_again = stub.requests[1]["messages"]
    assert [message["role"] for message in asked_again] == ["user", "assistant", "user"]
    assert asked_again[2]["content"][0]["text"].startswith("This names an object id.")


def test_what_the_model_fails_at_keeps_the_describers_texts(stub: Stub, folder: Path) -> None:
    """One stage refused, one cut off, one never right."""
    (task,) = load_tasks(folder, 1)
    bad = {"text": "One. Two. Three."}
    refused = {"message": {"role": "assistant", "content": None, "refusal": "No."}}
    stub.script = [refused, {"text": "Find", "finish_reason": "length"}, bad, bad]
    config = VlmConfig("gpt-4o", base_url=stub.url, api_key=KEY, max_concurrency=1, max_retries=0)
    writing = write_texts(folder, VlmClient(config), limit=1)
    assert writing.failures == {"refusal": 1, "truncated": 1, "unusable": 1}
    (after,) = load_tasks(folder, 1)
    assert after.public_stages[:3] == task.public_stages[:3]
    assert after.public_stages[0].writer.startswith("evonav-describer ")
    assert writing.num_written == task.num_stages - 3
    assert "has 3 sentences, twice" in " ".join(writing.messages)


def test_money_runs_out_between_tasks(stub: Stub, folder: Path) -> None:
    """What is paid for is written; the rest is as it was, and the next pass goes on."""
    before = {task.task_id: task for task in load_tasks(folder)}
    (first, *_) = before.values()
    account = Account(Price(2.5, 10.0), max_cost_usd=0.0035 * 2 * first.num_stages + 0.004)
    config = VlmConfig("gpt-4o", base_url=stub.url, api_key=KEY, max_concurrency=1)
    writing = write_texts(folder, VlmClient(config, account=account))
    assert writing.stopped is not None
    assert writing.stopped.kind == "over_budget"
    assert account.cost_usd is not None
    assert account.max_cost_usd is not None
    assert account.cost_usd <= account.max_cost_usd
    after = {task.task_id: task for task in load_tasks(folder)}
    assert [task_id for task_id in before if after[task_id].public_stages != before[task_id].public_stages] == [
        first.task_id
    ]
    assert not check_dataset(read_dataset(folder), folder)
    assert write_texts(folder, client_of(stub)).num_written == num_stages(list(before.values())) - first.num_stages


def test_an_interrupted_swap_is_put_right(stub: Stub, folder: Path) -> None:
    roots = sorted(path.parent for path in folder.glob("*/task.json"))
    roots[0].rename(folder / f".{roots[0].name}.old")
    (folder / f".{roots[1].name}.new").mkdir()
    assert write_texts(folder, client_of(stub)).num_done == 3
    assert not [path for path in folder.iterdir() if path.name.startswith(".")]


def test_a_damaged_task_is_told_and_the_others_stay_whole(stub: Stub, folder: Path) -> None:
    root = sorted(path.parent for path in folder.glob("*/task.json"))[1]
    (root / "public/stage_1.json").write_text("{}")
    with pytest.raises(TaskError, match=r"stage_1\.json"):
        write_texts(folder, client_of(stub))
    (root / "public/stage_1.json").unlink()
    root.rename(folder.parent / "away")
    assert len(list(load_tasks(folder))) == 2
    with pytest.raises(TaskError, match="holds no task"):
        write_texts(folder.parent / "nowhere", client_of(stub))


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("Find the tall, white fridge beside the 2-door cabinet.", None),
        ("Navigate to the mug. It stands on the L-shaped counter.", None),
        ("Find the bottle approx. half a metre tall.", None),
        ("Find the TV near the sofa.", None),
        ("", "has no words"),
        ("7.", "has no words"),
        ("mug " * 600, "is 2400 characters long"),
        ("Go. There. Now.", "has 3 sentences"),
        ("Find Mug|surface|4|12.", "names an object id"),
        ("Find Alarm_Clock_1.", "names an object id"),
        ("Find the mug (object ID 7).", "names an object id"),
        ("Find the mug at (1.25, 0.9, -3).", "gives coordinates"),
        ("Find the mug at x = 3.", "gives coordinates"),
        ("Find the mug in the simulated kitchen.", "uses words of the simulator"),
        ("Find the mug in the AI2-THOR scene.", "uses words of the simulator"),
        ("Find the\x07 mug.", "has control characters"),
    ],
)
def test_what_may_stand(text: str, fault: str | None) -> None:
    assert writer.fault_of(text) == fault


def test_the_describers_texts_may_stand() -> None:
    with as_file(files("evonav") / "data" / "tasks") as directory:
        for task in load_tasks(directory):
            for public in task.public_stages:
                for text in (public.basic_instruction, public.appearance_instruction, public.unified_instruction):
                    assert writer.fault_of(text) is None, text


def test_marks_around_an_answer_go() -> None:
    for answer in ('"Find it."', "**Instruction:** Find it.", "Navigation instruction: “Find it.”", " Find\n it. "):
        assert writer.cleaned(answer) == "Find it."


@pytest.mark.slow
def test_the_command(stub: Stub, folder: Path, tmp_path: Path) -> None:
    prices = tmp_path / "prices.json"
    prices.write_text('{"gpt-4o": {"input_usd": 2.5, "output_usd": 10}}')
    options = [
        "--model",
        "gpt-4o",
        "--base-url",
        stub.url,
        "--prices",
        str(prices),
        "--set",
        f"decision.exchanges={tmp_path / 'kept.sqlite'}",
    ]

    def run(*more: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "evonav", "tasks", "write", str(folder), *options, *more]
        return subprocess.run(
            command, capture_output=True, text=True, env={**os.environ, "OPENAI_API_KEY": KEY}, check=False
        )

    stages = num_stages(list(load_tasks(folder)))
    dry = run("--dry-run")
    assert re.search(rf"^{2 * stages} questions, 0 answered by the cache.*\n.*\$0\.", dry.stdout), (
        dry.stdout + dry.stderr
    )
    assert not stub.requests
    poor = run("--max-cost", "0.02")
    assert poor.returncode == 3
    assert "over_budget" in poor.stderr
    done = run()
    assert done.returncode == 0, done.stderr
    assert "stages written" in done.stdout
    assert len(stub.requests) == 2 * stages
    assert {stage.writer for task in load_tasks(folder) for stage in task.public_stages} == {"vlm:gpt-4o"}
    wrong = run("--model", "unpriced")
    assert (wrong.returncode, wrong.stderr.count("\n")) == (1, 1)
    assert "unpriced" in wrong.stderr
    assert not [path for path in tmp_path.rglob("*") if path.is_file() and KEY.encode() in path.read_bytes()]
