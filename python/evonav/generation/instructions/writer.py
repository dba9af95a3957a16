"""Has a model write the appearance and unified instructions of tasks that are there (paper, Sec. A.4).

A pass of its own after generation, which it keeps fast and free of networks: it can be stopped and gone on with, and a
task is either wholly as before or wholly rewritten. A stage whose texts the model does not get right keeps those of
the describer, and says so in `writer`.
"""

import contextlib
import dataclasses
import shutil
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evonav.decision.prompts import Prompt
from evonav.decision.vlm.account import Usage
from evonav.decision.vlm.client import VlmClient
from evonav.decision.vlm.errors import LASTING, VlmError
from evonav.errors import TaskError
from evonav.generation.instructions.prompts import (
    appearance_question,
    cleaned,
    fault_of,
    repair_request,
    unified_question,
)
from evonav.parallel.folders import put_folder
from evonav.tasks.dataset import DATASET_NAME, TaskEntry, entry_of, read_dataset, write_dataset
from evonav.tasks.files import checksums_of, load_task, write_task
from evonav.tasks.listing import task_roots
from evonav.tasks.manifest import PublicStage, Task


@dataclass
class Writing:
    """How far a pass has come."""

    num_tasks: int = 0
    num_done: int = 0
    """Tasks looked at, those included that were written before."""
    num_written: int = 0
    """Stages that now have the model's texts."""
    num_kept: int = 0
    """Stages that had them before."""
    failures: Counter[str] = field(default_factory=Counter)
    """Stages that keep the describer's texts, by failure."""
    messages: list[str] = field(default_factory=list)
    stopped: VlmError | None = None
    """What ended the pass early."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """What a pass would cost."""

    num_questions: int
    """At least: a repair is one more."""
    num_kept: int
    """Of those, answered by the exchanges."""
    usage: Usage
    """Of the others, rather too much than too little."""


def writer_of(client: VlmClient) -> str:
    """What `PublicStage.writer` says of a model's texts."""
    return f"vlm:{client.config.model}"


def write_texts(
    directory: Path | str,
    client: VlmClient,
    *,
    limit: int | None = None,
    on_task: Callable[[Writing], None] | None = None,
) -> Writing:
    """Rewrites the public texts of a folder's tasks, their checksums, and those of its `dataset.json`.

    As many tasks are under way as the client asks questions at a time.

    Args:
        directory: Holds one directory a task.
        client: Of the model.
        limit: Most tasks; default all.
        on_task: Called after each task.

    Raises:
        TaskError: A task cannot be read or written; what was written before stays.
        StoreError: The exchanges cannot be read or written.
        DecisionError: The package `openai` or a key is missing.
    """
    directory = Path(directory)
    roots = _roots(directory, limit)
    writing = Writing(num_tasks=len(roots))
    entries: dict[str, TaskEntry] = {}
    try:
        stop = threading.Event()
        with ThreadPoolExecutor(client.config.max_concurrency) as pool:
            waiting: set[Future[tuple[Task, Writing]]] = set()
            try:
                for root in [*roots, None]:
                    if root is not None and writing.stopped is None:
                        waiting.add(pool.submit(_write_task, root, client, stop))
                    at_most = 0 if root is None else 2 * client.config.max_concurrency
                    while len(waiting) > at_most:
                        done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                        for future in done:
                            task, part = future.result()
                            entries[task.task_id] = entry_of(task)
                            _add(writing, part)
                            if on_task is not None:
                                on_task(writing)
            except BaseException:
                stop.set()
                pool.shutdown(wait=True, cancel_futures=True)
                raise
    finally:
        _update_dataset(directory, entries)
    writing.messages.sort()
    return writing


def estimate_texts(directory: Path | str, client: VlmClient, *, limit: int | None = None) -> Estimate:
    """What `write_texts` would ask; nothing is asked.

    Raises:
        TaskError: A task cannot be read.
    """
    num_questions, num_kept, usage = 0, 0, Usage()
    for root in _roots(Path(directory), limit):
        task = load_task(root)
        for public, image in zip(task.public_stages, task.reference_images, strict=True):
            if public.writer == writer_of(client):
                continue
            # The appearance text that the second question will have is not known yet.
            for question in (
                appearance_question(public.category, public.basic_instruction, image),
                unified_question(public.basic_instruction, public.appearance_instruction, image),
            ):
                is_kept = client.is_cached(question)
                num_questions += 1
                num_kept += is_kept
                usage += Usage() if is_kept else client.estimate(question)
    return Estimate(num_questions, num_kept, usage)


def write_stage(public: PublicStage, image: NDArray[np.uint8], client: VlmClient) -> PublicStage:
    """A stage's public part with the model's texts.

    Raises:
        VlmError: The model does not write them so that they can stand.
    """
    basic = public.basic_instruction
    appearance = _text(client, appearance_question(public.category, basic, image))
    unified = _text(client, unified_question(basic, appearance, image))
    texts = {"appearance_instruction": appearance, "unified_instruction": unified, "writer": writer_of(client)}
    return public.model_copy(update=texts)


def _text(client: VlmClient, question: Prompt) -> str:
    """An instruction, asked for once more if the first cannot stand."""
    answer = client.ask(question).text
    text = cleaned(answer)
    fault = fault_of(text)
    if fault is not None:
        text = cleaned(client.ask(question.then(answer, repair_request(fault))).text)
        fault = fault_of(text)
    if fault is not None:
        raise VlmError("unusable", f"an answer that {fault}, twice: {text[:80]!r}")
    return text


def _write_task(root: Path, client: VlmClient, stop: threading.Event) -> tuple[Task, Writing]:
    """Rewrites one task, unless something ends the pass before it is whole."""
    task = load_task(root)
    part = Writing(num_done=1)
    stages: list[PublicStage] = []
    for public, image in zip(task.public_stages, task.reference_images, strict=True):
        if public.writer == writer_of(client):
            part.num_kept += 1
            stages.append(public)
            continue
        if stop.is_set():
            return task, Writing()
        try:
            stages.append(write_stage(public, image, client))
            part.num_written += 1
        except VlmError as error:
            if error.kind in LASTING:
                return task, Writing(stopped=error)
            part.failures[error.kind] += 1
            part.messages.append(f"{task.task_id} stage {public.stage}: {error}")
            stages.append(public)
    if part.num_written:
        changed = dataclasses.replace(task, public_stages=tuple(stages))
        header = task.header.model_copy(update={"checksums": checksums_of(changed)})
        task = dataclasses.replace(changed, header=header)
        _swap(task, root)
    return task, part


def _swap(task: Task, root: Path) -> None:
    """Puts a task's files in place of the old ones, all or none.

    Raises:
        TaskError: They cannot be written.
    """
    old, new = root.with_name(f".{root.name}.old"), root.with_name(f".{root.name}.new")
    try:
        shutil.rmtree(new, ignore_errors=True)
        put_folder(write_task(task, new), root, aside=old)
        new.rmdir()
    except OSError as error:
        raise TaskError(f"{root}: cannot be written: {error.strerror or error}") from error


def _roots(directory: Path, limit: int | None) -> list[Path]:
    """The tasks' directories, in order; those that an interrupted pass had set aside are put back.

    Raises:
        TaskError: There is none, or one cannot be put back.
    """
    with _told(directory):
        for old in directory.glob(".*.old"):
            root = old.with_name(old.name.removeprefix(".").removesuffix(".old"))
            if root.exists():
                shutil.rmtree(old)
            else:
                old.rename(root)
        for new in directory.glob(".*.new"):
            shutil.rmtree(new)
    return task_roots(directory)[:limit]


@contextlib.contextmanager
def _told(directory: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise TaskError(f"{directory}: {error.strerror or error}") from error


def _update_dataset(directory: Path, entries: dict[str, TaskEntry]) -> None:
    """Writes the tasks' new checksums into `dataset.json`, if there is one."""
    if not entries or not (directory / DATASET_NAME).exists():
        return
    record = read_dataset(directory)
    tasks = tuple(entries.get(entry.task_id, entry) for entry in record.tasks)
    if tasks != record.tasks:
        write_dataset(record.model_copy(update={"tasks": tasks}), directory)


def _add(writing: Writing, part: Writing) -> None:
    writing.num_done += part.num_done
    writing.num_written += part.num_written
    writing.num_kept += part.num_kept
    writing.failures += part.failures
    writing.messages += part.messages
    writing.stopped = writing.stopped or part.stopped
