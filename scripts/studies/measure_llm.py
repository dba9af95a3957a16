"""What a real text model answers to the agents' questions: `python scripts/studies/measure_llm.py --tasks TASKS`.

Needs a server (`serve_llm.py`). The text matcher decides, so every model meets the same questions; of
each kind of question some, spread over the episodes, also go to the model, without images. Prints for each kind how
many answers were valid by the question's grammar, how many equal the text matcher's, how many would by chance where
the valid answers can be listed, and the time that an answer takes.
"""

import argparse
import json
import os
import statistics
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

from evonav.component import Component
from evonav.decision.backends import text_match, vlm
from evonav.decision.question import AnswerError, ClosedQuestion, DecisionModel, Question, Reply
from evonav.evaluation.hosting.isolation import AgentHosting
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import RunConfig
from evonav.statistics import wilson
from evonav.tasks.listing import task_files

AGENTS = "fu,ftu,3d-mem,msgnav,unigoal-paper"
A = TypeVar("A")


class Compared(DecisionModel):
    """The text matcher, which also shows some questions to a model and notes both answers in a file."""

    needs = frozenset()

    def __init__(self, seed: int, log: str, model: str, base_url: str, stride: int, limit: int) -> None:
        """Create the pair; every `stride`-th question of a kind is asked until `limit` were."""
        self._rule = text_match(seed)
        self._model = vlm(
            seed,
            model=model,
            images=False,
            request={"max_tokens": 300},
            server={"base_url": base_url, "timeout_s": 600.0},
        )
        self._log, self._stride, self._limit = Path(log), stride, limit
        self._num_seen: Counter[str] = Counter()

    def answer(self, question: Question[A], attempt: int = 0) -> Reply[A]:
        """Return the text matcher's answer."""
        reply = self._rule.answer(question, attempt)
        kind = question.kind
        if attempt == 0 and self._num_seen[kind] % self._stride == 0 and self._num_asked(kind) < self._limit:
            self._note(question, reply)
        self._num_seen[kind] += 1
        return reply

    def _num_asked(self, kind: str) -> int:
        return sum(row["kind"] == kind for row in read_log(self._log))

    def _note(self, question: Question[A], rule: Reply[A]) -> None:
        begun = time.perf_counter()
        fault, text, agrees = "", "", False
        try:
            found = self._model.answer(question)
            text, agrees = found.text, found.answer == rule.answer
        except AnswerError as error:
            fault, text = error.fault, error.text
        num_choices = len(question.choices()) if isinstance(question, ClosedQuestion) else None
        row = {
            "kind": question.kind,
            "fault": fault,
            "agrees": agrees,
            "num_choices": num_choices,
            "seconds": time.perf_counter() - begun,
            "rule": question.answer_text(rule.answer),
            "text": text,
        }
        with self._log.open("a", encoding="utf-8") as log:
            log.write(json.dumps(row) + "\n")


def compared(seed: int, **options: Any) -> Compared:  # noqa: ANN401 - JSON
    """Make the decision model of a run."""
    return Compared(seed, **options)


def read_log(log: Path) -> list[dict[str, Any]]:
    """Rows of all answers so far."""
    return [json.loads(line) for line in log.read_text("utf-8").splitlines()] if log.exists() else []


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Markdown: a row for each kind of question."""
    lines = [
        "| question | asked | valid | as the text matcher | by chance | seconds, median |",
        "| --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    for kind in dict.fromkeys(row["kind"] for row in rows):
        part = [row for row in rows if row["kind"] == kind]
        chances = [1 / row["num_choices"] for row in part if row["num_choices"]]
        chance = f"{100 * statistics.mean(chances):.0f}%" if chances else "–"
        seconds = statistics.median(row["seconds"] for row in part)
        valid, agrees = (_share([bool(x) for x in flags]) for flags in _flags(part))
        lines.append(f"| `{kind}` | {len(part)} | {valid} | {agrees} | {chance} | {seconds:.1f} |")
    return "\n".join(lines)


def _flags(rows: Sequence[dict[str, Any]]) -> tuple[list[bool], list[bool]]:
    return [not row["fault"] for row in rows], [row["agrees"] for row in rows]


def _share(flags: Sequence[bool]) -> str:
    low, high = wilson(sum(flags), len(flags))
    return f"{100 * sum(flags) / len(flags):.0f}% [{100 * low:.0f}, {100 * high:.0f}]"


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", type=Path, required=True)
    parser.add_argument("--num-tasks", type=int, default=3)
    parser.add_argument("--agents", default=AGENTS)
    parser.add_argument("--model", default="qwen2.5-coder-1.5b-instruct-q4_k_m")
    parser.add_argument("--base-url", default="http://127.0.0.1:8000/v1")
    parser.add_argument("--stride", type=int, default=5, help="every how many questions of a kind one is asked")
    parser.add_argument("--limit", type=int, default=20, help="questions of a kind")
    parser.add_argument("--out", type=Path, default=Path("out/llm"))
    asked = parser.parse_args()
    os.environ.setdefault("OPENAI_API_KEY", "none")
    asked.out.mkdir(parents=True, exist_ok=True)
    log = asked.out / "answers.jsonl"
    options = {
        "log": str(log),
        "model": asked.model,
        "base_url": asked.base_url,
        "stride": asked.stride,
        "limit": asked.limit,
    }
    sys.modules["measure_llm"] = sys.modules["__main__"]
    config = RunConfig(
        backend=Backend(decision=Component("measure_llm:compared", options)), hosting=AgentHosting("none")
    )
    evaluate(
        asked.agents.split(","),
        task_files(asked.tasks, asked.num_tasks),
        asked.out / "run",
        config=config,
        num_workers=0,
    )
    sys.stdout.write(table(read_log(log)) + "\n")


if __name__ == "__main__":
    main()
