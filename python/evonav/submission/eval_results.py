"""Write the results of a packed run in the Hugging Face Hub's form, for the repository of a model."""

from pathlib import Path

from evonav.counted import counted
from evonav.drawing.svg import slug
from evonav.parallel.folders import write_atomically
from evonav.report.cards.hub_benchmark import METRICS, RESULTS_DIR, eval_results_yaml
from evonav.report.cards.yaml_text import Yaml
from evonav.submission.file import SUFFIX, SubmissionFile
from evonav.submission.packed_setup import packed_setup


def write_eval_results(pack: Path, dataset: str) -> list[Path]:
    """Write `.eval_results/PACK-AGENT.yaml` beside a packed run, for each of its agents.

    Args:
        dataset: Repository of its tasks on the Hub, with `@REVISION` if one is meant.

    Returns:
        The files.

    Raises:
        InvalidArgumentError: No leaderboard is for the run's perception, or the repository's name is malformed.
        SubmissionError: The file is no packed run.
        StoreError: A file cannot be written.
    """
    with SubmissionFile(pack) as file:
        header, date = file.header, file.date
    setup, about = packed_setup(header), header.about
    texts = {}
    for agent, row in header.summary["agents"].items():
        decision = f"{setup.decision} {setup.model}".strip()
        notes = [
            f"agent {agent}",
            f"decision {decision}",
            counted(len(header.tasks), "task"),
            counted(row["n"], "stage"),
        ]
        intervals = {metric: row[f"{metric}_ci95"] for metric in METRICS}
        notes += [
            f"{metric.upper()} 95% CI {100 * ends[0]:.1f} to {100 * ends[1]:.1f}"
            for metric, ends in intervals.items()
            if ends is not None
        ]
        details: dict[str, Yaml] = {"date": date} if date else {}
        if about.url:
            details["source"] = {"url": about.url, **({"name": about.title} if about.title else {})}
        details["notes"] = "; ".join([*notes, f"evonav {header.evonav}"])
        percentages = {metric: 100 * row[metric] for metric in METRICS}
        texts[agent] = eval_results_yaml(dataset, setup.perception, percentages, details)
    folder, name = pack.parent / RESULTS_DIR, pack.name.removesuffix(SUFFIX)
    return [write_atomically(folder / f"{name}-{slug(agent)}.yaml", text) for agent, text in texts.items()]
