"""Have a model write the appearance and unified instructions of existing tasks (paper, Sec. A.4).

This is a separate pass after generation, so that generation stays fast and needs no network. It is safe to interrupt
and to run again: each task's files are replaced atomically. A stage for which the model gives no usable text keeps the
rule-based instructions; its `writer` field says so.
"""

import dataclasses
import re
import shutil
import threading
from collections import Counter
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evonav.decision.pictures import Picture
from evonav.decision.prompts import Prompt
from evonav.decision.vlm.account import Usage
from evonav.decision.vlm.client import VlmClient
from evonav.decision.vlm.errors import LASTING, VlmError
from evonav.errors import TaskError
from evonav.parallel.folders import put_folder
from evonav.tasks.dataset import DATASET_NAME, TaskEntry, entry_of, read_dataset, write_dataset
from evonav.tasks.files import load_task, write_task
from evonav.tasks.language import noun_of
from evonav.tasks.listing import task_roots
from evonav.tasks.manifest import PublicStage, Task

APPEARANCE_PROMPT = (
    "Given the target category, the basic instruction, and the reference image, write one short navigation instruction "
    "that identifies the target mainly by visible appearance, including shape and color first, and material, texture, "
    "size, or distinctive parts when helpful.\n"
    "Do not mention coordinates, object IDs, simulator terms, or invisible attributes."
)
"""The paper's prompt for appearance instructions."""
UNIFIED_PROMPT = (
    "Given the basic instruction, the appearance instruction, and the reference image, write one concise navigation "
    "instruction that combines spatial relations with visual appearance.\n"
    "Keep relations such as on, next to, near, or below only when they are supported by the image."
)
"""The paper's prompt for unified instructions."""
UNIFIED_TEXT_PROMPT = (
    "Given the basic instruction and the appearance instruction, write one concise navigation instruction that "
    "combines spatial relations with visual appearance."
)
"""The same without what it says of the reference image, for models that read text only."""

MAX_CHARACTERS = 2000
MAX_SENTENCES = 2

_FAULTS: tuple[tuple[str, str], ...] = (
    (r"[\w.]\|[+-]?\w", "names an object id"),
    (r"\b[A-Za-z]+_[A-Za-z0-9_]+\b", "names an object id"),
    (r"\b(?:object|instance|asset)[ -]?ids?\b", "names an object id"),
    (r"\(\s*-?\d+(?:\.\d+)?\s*,\s*-?\d", "gives coordinates"),
    (r"\b[xyz]\s*[=:]\s*-?\d", "gives coordinates"),
    (r"\bcoordinates?\b", "gives coordinates"),
    (r"\b(?:simulat\w+|ai2[- ]?thor|procthor|ithor|unity|prefab|asset|rendered|rendering|3d model|bounding box)\b",
     "uses words of the simulator"),
)  # fmt: skip


@dataclass
class Writing:
    """Progress of a pass over tasks."""

    num_tasks: int = 0
    num_done: int = 0
    """Number of processed tasks, including those written before."""
    num_written: int = 0
    """Number of stages written by this pass."""
    num_written_before: int = 0
    """Number of stages that had the model's texts before."""
    failures: Counter[str] = field(default_factory=Counter)
    """Number of stages that keep the rule-based texts, by failure."""
    messages: list[str] = field(default_factory=list)
    stopped: VlmError | None = None
    """The error that ended the pass early."""


@dataclass(frozen=True, slots=True)
class WritingEstimate:
    """Estimated cost of a pass."""

    num_questions: int
    """Smallest number of questions; each correction of an answer is one more."""
    num_cached: int
    """Number of questions with a cached answer."""
    usage: Usage
    """Estimated usage of the remaining questions (upper bound)."""


def writer_of(client: VlmClient, images: bool = True) -> str:
    """Return the value of `PublicStage.writer` for a model's texts."""
    return f"vlm:{client.config.model}" if images else f"vlm:{client.config.model}, without images"


def write_texts(
    directory: Path | str,
    client: VlmClient,
    *,
    images: bool = True,
    limit: int | None = None,
    on_task: Callable[[Writing], None] | None = None,
) -> Writing:
    """Rewrite the instructions of a folder's tasks, and all checksums that depend on them.

    Args:
        client: Client of the model; its limit on concurrent questions also limits the concurrent tasks.
        images: Show the reference images to the model. Without them, the appearance instructions stay the describer's
            and the model writes the unified ones from the texts alone.
        limit: Number of tasks, from the first; default all.
        on_task: Called after each task.

    Raises:
        TaskError: A task cannot be read or written; tasks written before stay rewritten.
        StoreError: The response cache cannot be read or written.
        DecisionError: The package `openai` or an API key is missing.
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
                        waiting.add(pool.submit(_write_task, root, client, images, stop))
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


def estimate_texts(
    directory: Path | str, client: VlmClient, *, images: bool = True, limit: int | None = None
) -> WritingEstimate:
    """Estimate the cost of `write_texts` without asking any question.

    Raises:
        TaskError: A task cannot be read.
    """
    num_questions, num_cached, usage = 0, 0, Usage()
    for root in _roots(Path(directory), limit):
        task = load_task(root)
        for public, image in zip(task.public_stages, task.reference_images, strict=True):
            if public.writer == writer_of(client, images):
                continue
            questions = [appearance_question(public.category, public.basic_instruction, image)] if images else []
            # With images, this question will contain the model's appearance text, which is not known yet.
            shown = image if images else None
            questions.append(unified_question(public.basic_instruction, public.appearance_instruction, shown))
            for question in questions:
                is_cached = client.is_cached(question)
                num_questions += 1
                num_cached += is_cached
                usage += Usage() if is_cached else client.estimate(question)
    return WritingEstimate(num_questions, num_cached, usage)


def write_stage(public: PublicStage, image: NDArray[np.uint8] | None, client: VlmClient) -> PublicStage:
    """Return a stage's public part with the model's texts; without an image only the unified instruction is new.

    Raises:
        VlmError: The model gives no usable text.
    """
    basic = public.basic_instruction
    appearance = public.appearance_instruction
    if image is not None:
        appearance = _text(client, appearance_question(public.category, basic, image))
    unified = _text(client, unified_question(basic, appearance, image))
    writer = writer_of(client, images=image is not None)
    texts = {"appearance_instruction": appearance, "unified_instruction": unified, "writer": writer}
    return public.model_copy(update=texts)


def _text(client: VlmClient, question: Prompt) -> str:
    """Ask for an instruction, once more if the first answer is unusable."""
    answer = client.ask(question)
    text = cleaned(answer)
    fault = fault_of(text)
    if fault is not None:
        text = cleaned(client.ask(question.then(answer, repair_request(fault))))
        fault = fault_of(text)
    if fault is not None:
        raise VlmError("unusable", f"an answer that {fault}, twice: {text[:80]!r}")
    return text


def _write_task(root: Path, client: VlmClient, images: bool, stop: threading.Event) -> tuple[Task, Writing]:
    """Rewrite one task, or leave it as it was if the pass ends first."""
    task = load_task(root)
    part = Writing(num_done=1)
    stages: list[PublicStage] = []
    for public, image in zip(task.public_stages, task.reference_images, strict=True):
        if public.writer == writer_of(client, images):
            part.num_written_before += 1
            stages.append(public)
            continue
        if stop.is_set():
            return task, Writing()
        try:
            stages.append(write_stage(public, image if images else None, client))
            part.num_written += 1
        except VlmError as error:
            if error.kind in LASTING:
                return task, Writing(stopped=error)
            part.failures[error.kind] += 1
            part.messages.append(f"{task.task_id} stage {public.stage}: {error}")
            stages.append(public)
    if part.num_written:
        task = dataclasses.replace(task, public_stages=tuple(stages)).with_checksums()
        _swap(task, root)
    return task, part


def _swap(task: Task, root: Path) -> None:
    """Replace a task's folder atomically."""
    old, new = root.with_name(f".{root.name}.old"), root.with_name(f".{root.name}.new")
    try:
        shutil.rmtree(new, ignore_errors=True)
        put_folder(write_task(task, new), root, aside=old)
        new.rmdir()
    except OSError as error:
        raise TaskError(f"{root}: cannot be written: {error.strerror or error}") from error


def _roots(directory: Path, limit: int | None) -> list[Path]:
    """List the tasks' folders in order, after restoring those that an interrupted pass had moved aside."""
    try:
        for old in directory.glob(".*.old"):
            root = old.with_name(old.name.removeprefix(".").removesuffix(".old"))
            if root.exists():
                shutil.rmtree(old)
            else:
                old.rename(root)
        for new in directory.glob(".*.new"):
            shutil.rmtree(new)
    except OSError as error:
        raise TaskError(f"{directory}: {error.strerror or error}") from error
    return task_roots(directory)[:limit]


def _update_dataset(directory: Path, entries: dict[str, TaskEntry]) -> None:
    """Write the tasks' new checksums into `dataset.json`, if it exists."""
    if not entries or not (directory / DATASET_NAME).exists():
        return
    record = read_dataset(directory)
    tasks = tuple(entries.get(entry.task_id, entry) for entry in record.tasks)
    if tasks != record.tasks:
        write_dataset(record.model_copy(update={"tasks": tasks}), directory)


def _add(writing: Writing, part: Writing) -> None:
    writing.num_done += part.num_done
    writing.num_written += part.num_written
    writing.num_written_before += part.num_written_before
    writing.failures += part.failures
    writing.messages += part.messages
    writing.stopped = writing.stopped or part.stopped


def appearance_question(category: str, basic: str, image: NDArray[np.uint8]) -> Prompt:
    """Return the prompt that asks for an appearance instruction.

    Args:
        category: The target's category, as ProcTHOR spells it.
        basic: The target's basic instruction.
        image: `(H, W, 3)` RGB reference image.
    """
    inputs = f"Target category: {noun_of(category)}\nBasic instruction: {basic}\nReference image:"
    return Prompt.of(f"{APPEARANCE_PROMPT}\n\n{inputs}", Picture(image))


def unified_question(basic: str, appearance: str, image: NDArray[np.uint8] | None) -> Prompt:
    """Return the prompt that asks for a unified instruction.

    Args:
        basic: The target's basic instruction.
        appearance: The target's appearance instruction.
        image: `(H, W, 3)` RGB reference image; `None` for a model that reads text only, which is not told of one.
    """
    inputs = f"Basic instruction: {basic}\nAppearance instruction: {appearance}"
    if image is None:
        return Prompt.of(f"{UNIFIED_TEXT_PROMPT}\n\n{inputs}")
    return Prompt.of(f"{UNIFIED_PROMPT}\n\n{inputs}\nReference image:", Picture(image))


def repair_request(fault: str) -> str:
    """Return the request to correct an unusable answer."""
    return f"This {fault}. Write it again as one or two plain sentences, and nothing else."


def cleaned(answer: str) -> str:
    """Return an answer as one line, without the quotes, labels and formatting that models add around it."""
    line = " ".join(answer.split()).strip()
    line = re.sub(r"^(?:\*\*|__)?[A-Za-z ]{0,30}instruction(?:\*\*|__)?\s*:\s*(?:\*\*|__)?\s*", "", line, flags=re.I)
    line = line.strip("*` ")
    if len(line) > 1 and line[0] in "\"'“‘" and line[-1] in "\"'”’":
        line = line[1:-1].strip()
    return line


def fault_of(text: str) -> str | None:
    """Return the reason why a text is no usable instruction, or `None` if it is usable."""
    if not re.search(r"[A-Za-z]{2}", text):
        return "has no words"
    if len(text) > MAX_CHARACTERS:
        return f"is {len(text)} characters long"
    num_sentences = len([part for part in re.split(r"(?<=[.!?])[\"'”’)]*\s+(?=[A-Z\"'“(])", text) if part.strip()])
    if num_sentences > MAX_SENTENCES:
        return f"has {num_sentences} sentences"
    if any(ord(character) < 32 for character in text):
        return "has control characters"
    return next((fault for pattern, fault in _FAULTS if re.search(pattern, text, re.IGNORECASE)), None)
