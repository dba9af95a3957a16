"""Write a folder of tasks with its cards, ready for a dataset hub: README.md, croissant.json and eval.yaml."""

import json
import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup

from evonav.counted import counted
from evonav.errors import InvalidArgumentError, StoreError, TaskError
from evonav.parallel.folders import sha256_of_file, write_atomically
from evonav.report.cards.croissant import CROISSANT_NAME, METADATA_NAME, croissant
from evonav.report.cards.hub_benchmark import CONFIG, EVAL_NAME, REPO, eval_yaml
from evonav.report.cards.task_set import TaskSet, read_task_set
from evonav.report.cards.yaml_text import Yaml, yaml_text
from evonav.report.pages.template import page_environment
from evonav.report.tables.table import Table
from evonav.tasks.dataset import DATASET_NAME
from evonav.tasks.statistics import Estimate, Metric, TaskStatistics

README_NAME = "README.md"
BUNDLED_LICENSE = "apache-2.0"
PLACEHOLDER = "ORG/NAME"
"""Repository of a card that names none."""
MAX_LISTED = 200
"""Largest number of tasks whose checksums the card repeats from `dataset.json`."""
_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))
_LICENSE = re.compile(r"[a-z0-9][a-z0-9.-]*")
_DATE = re.compile(r"\d{4}-\d\d-\d\d")


@dataclass(frozen=True, slots=True)
class CardOptions:
    """Options of a card, which the tasks do not hold."""

    date: str
    """Day of publication, such as 2026-11-23."""
    repo: str = PLACEHOLDER
    """Repository of the dataset on the Hub."""
    license: str | None = None
    """Identifier of the licence; default: that of the bundled houses, if the tasks are of them."""
    name: str | None = None
    """Name that people read; default: by the name in `dataset.json`."""


def write_dataset_card(folder: Path, out: Path, statistics: TaskStatistics, options: CardOptions) -> list[Path]:
    """Write the cards of a set of tasks, and copy its files if they go to another folder.

    Args:
        folder: A folder of tasks with its `dataset.json`, or that file.
        out: Folder to write to; the tasks' own folder gets the cards beside the tasks.
        options: Repository, licence, title and date.

    Returns:
        The cards: README.md first.

    Raises:
        InvalidArgumentError: An option is malformed, or the licence has to be given.
        TaskError: The tasks are incomplete or altered, or `out` holds other ones.
        StoreError: A file cannot be written.
    """
    _check(options)
    tasks = read_task_set(folder)
    license_id = _license(tasks, options.license)
    if out.resolve() != tasks.folder.resolve():
        _copy(tasks, out)
    metadata = write_atomically(out / METADATA_NAME, tasks.metadata)
    name = options.name or f"EvoNav-Bench: {tasks.record.name}"
    size = f"{counted(tasks.record.num_tasks, 'task')} with {counted(len(tasks.rows), 'stage')}"
    what = f"{size} in homes that change between visits"
    description = f"Lifelong navigation in {what}, in the form of EvoNav-Bench (arXiv:2609.08292)."
    about = {
        "name": tasks.record.name,
        "description": description,
        "license": license_id,
        "url": f"https://huggingface.co/datasets/{options.repo}",
        "version": tasks.record.generator.rpartition(" ")[2],
        "datePublished": options.date,
        "citeAs": " ".join(_citation().split()),
    }
    sha256s = {path.name: sha256_of_file(path) for path in (out / DATASET_NAME, metadata)}
    data = json.dumps(croissant(tasks, sha256s, about), indent=2, ensure_ascii=False) + "\n"
    return [
        write_atomically(out / README_NAME, _readme(tasks, statistics, options.repo, name, license_id, sha256s)),
        write_atomically(out / CROISSANT_NAME, data),
        write_atomically(out / EVAL_NAME, eval_yaml(name, description, tasks.split)),
    ]


def _check(options: CardOptions) -> None:
    for option, value, pattern, example in (
        ("--repo", options.repo, REPO, "my-lab/evonav-test"),
        ("--license", options.license, _LICENSE, "apache-2.0"),
        ("--date", options.date, _DATE, "2026-11-23"),
    ):
        if value is not None and not pattern.fullmatch(value):
            raise InvalidArgumentError(f"{option} {value!r}: expected a value such as {example}")


def _license(tasks: TaskSet, license_id: str | None) -> str:
    if license_id is not None:
        return license_id
    if tasks.has_bundled_houses:
        return BUNDLED_LICENSE
    sources = ", ".join(source.name for source in tasks.record.sources)
    raise InvalidArgumentError(
        f"the licence of the houses ({sources}) is not known: name it with --license, such as apache-2.0 or cc-by-4.0"
    )


def _copy(tasks: TaskSet, out: Path) -> None:
    there = {path.parent.name for path in out.glob("*/task.json")} - {entry.task_id for entry in tasks.record.tasks}
    if there:
        raise TaskError(f"{out}: holds other tasks, such as {min(there)}: name a new folder")
    try:
        for path in tasks.paths:
            (out / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(tasks.folder / path, out / path)
    except OSError as error:
        raise StoreError(f"{out}: cannot be written: {error.strerror or error}") from error


def _readme(
    tasks: TaskSet, statistics: TaskStatistics, repo: str, name: str, license_id: str, sha256s: dict[str, str]
) -> str:
    header: dict[str, Yaml] = {
        "license": license_id,
        "pretty_name": name,
        "language": ["en"],
        "task_categories": ["robotics"],
        "size_categories": [next((size for limit, size in _SIZES if len(tasks.rows) < limit), "n>1M")],
        "annotations_creators": ["machine-generated"],
        "tags": [
            "embodied-ai",
            "navigation",
            "object-goal-navigation",
            "lifelong-learning",
            "benchmark",
            "procthor",
            "ai2-thor",
            "evonav",
        ],
        "configs": [
            {
                "config_name": CONFIG,
                "data_files": [{"split": tasks.split, "path": [METADATA_NAME, "*/public/*.png"]}],
            }
        ],
    }
    template = page_environment().get_template("dataset_card.md.j2")
    text = template.render(
        header=Markup(yaml_text(header)),  # noqa: S704 - every value is quoted as YAML
        name=name,
        repo=repo,
        license=license_id,
        tasks=tasks,
        record=tasks.record,
        has_bundled_houses=tasks.has_bundled_houses,
        extensions=[name for name, value in tasks.record.parameters.extensions if value is not None],
        statistics=statistics,
        num_categories={key: len(_counts(statistics, key)) for key in ("goal_categories", "house_categories")},
        num_objects=sum(_counts(statistics, "house_categories")),
        paper=Markup(_paper_table(statistics).markdown()),  # noqa: S704 - numbers and our own labels
        dataset_sha256=sha256s[DATASET_NAME],
        max_listed=MAX_LISTED,
        citation=Markup(_citation()),  # noqa: S704 - our own text
        metadata_name=METADATA_NAME,
        eval_name=EVAL_NAME,
        croissant_name=CROISSANT_NAME,
    )
    return text + "\n"


def _counts(statistics: TaskStatistics, key: str) -> tuple[int, ...]:
    found = statistics.distribution(key)
    return () if found is None else found.counts


def _paper_table(statistics: TaskStatistics) -> Table:
    rows = [
        (metric.label.strip(), _scaled(metric, metric.paper), _estimate(metric, metric.raw), str(metric.n))
        for metric in statistics.measures
        if metric.raw is not None and metric.paper is not None
    ]
    return Table("Beside the paper", ("", "paper", "here [95% CI]", "n"), tuple(rows))


def _estimate(metric: Metric, estimate: Estimate) -> str:
    ends = "–" if estimate.ci95 is None else ", ".join(_scaled(metric, end) for end in estimate.ci95)
    return f"{_scaled(metric, estimate.value)} [{ends}]"


def _scaled(metric: Metric, value: float) -> str:
    return f"{100 * value:.1f}%" if "share" in metric.unit else f"{value:.2f}"


def _citation() -> str:
    return """\
@article{wang2026evonav,
  title   = {EvoNav-Bench: Benchmarking Lifelong Navigation in Evolving Environments},
  author  = {Wang, Xilin and Zhang, Guoxi and Xu, Hongming and Zhang, Zhuofan and Wang, Tianxu and Fan, Lifeng},
  journal = {arXiv preprint arXiv:2609.08292},
  year    = {2026},
  url     = {https://arxiv.org/abs/2609.08292}
}"""
