"""Agents compared with each other and with the paper: runs them, and writes the marked parts of the pages of results.

    python scripts/studies/results.py --out out/results --tasks TASKS/hard TASKS/tiny-val:10 --small TASKS/attr

evaluates all six agents on all tasks of the folders (the first 10 of the last), and on those of small houses, then
agents that depart from the originals or from the paper, then five agents on a subset with decisions that go wrong at
stated rates, and writes tables and a plot. A house may have tasks of several seeds. Run it again to resume;
`--write-only` runs nothing. A folder of results holds one version of the code: give another version another folder.
"""

import argparse
import re
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from behaviour_tables import STRATA, cause_share_table, end_table, ends_of, success_by_group

from evonav.component import Component
from evonav.evaluation.agent_order import PAPER_ORDER
from evonav.evaluation.hosting.isolation import AgentHosting
from evonav.evaluation.run.components import Backend
from evonav.evaluation.run.evaluate import evaluate
from evonav.evaluation.run.run import Progress, RunConfig
from evonav.evaluation.run.settings import SimulatorSettings
from evonav.perception.shorthand import parse_perception
from evonav.report.compare.compare import compare
from evonav.report.compare.selection import ComparedAgent
from evonav.report.paper.reweighted import reweighted_table
from evonav.report.paper.tables import paper_tables
from evonav.report.plots.render import write_plots
from evonav.report.plots.specs import CurvePlot, Line
from evonav.report.run import RecordedRun, load_run
from evonav.report.tables.numbers import NONE, percent, points, rate
from evonav.report.tables.run_tables import effort_table
from evonav.report.tables.table import Table
from evonav.statistics import wilson
from evonav.tasks.listing import TaskFile, task_files

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "docs" / "results.md", *sorted((ROOT / "docs" / "studies").glob("*.md")))
PLOT = ROOT / "docs" / "images" / "decision-errors.svg"
HEADLINE = "noisy:perfect,features=true"
"""Perception of the main runs: true masks and labels, and image features by which entries are ranked, as the paper's
agents rank them by CLIP (Sec. C.4)."""
RATES = (0.0, 0.05, 0.1, 0.2, 0.4)
"""Shares of decisions that are another valid answer than the model's own."""
RANKING_AGENTS = ("fu", "stage-reset", "ftu")
"""Agents that rank entries by image features, and by labels where there are none."""
WIDE_AGENTS = ("fu", "3d-mem", "msgnav")
"""Agents that are also run with the camera of 3D-Mem's and MSGNav's released code, 120 degrees wide."""
LOOKING, DECLINING = (
    f"{Path(__file__).with_name('departing_agents.py')}:{name}"
    for name in ("msgnav_looking_on_arrival", "unigoal_that_may_decline")
)
"""Agents that depart from their originals in one point."""
DEPARTURES = (
    *(("our fallback for frontiers", ("plus", f"{agent}+"), ("main", agent)) for agent in ("3d-mem", "msgnav")),
    *(("entries ranked by labels", ("labels", agent), ("main", agent)) for agent in RANKING_AGENTS),
    *(("a camera of 120 degrees", ("wide", agent), ("main", agent)) for agent in WIDE_AGENTS),
    ("a check that sees the place itself", ("departing", LOOKING), ("main", "msgnav")),
    ("UniGoal may name no category", ("departing", DECLINING), ("main", "unigoal")),
)
"""What is different, and folder and agent of the runs with and without it."""
ROOM_GROUPS = ((2, 3), (4, 5), (6, 10))


def main() -> None:
    """See the module."""
    asked = _arguments()
    tasks = pooled_tasks(asked.tasks)
    agents = asked.agents.split(",")
    subset = spread(tasks, asked.sweep)
    if not asked.write_only:
        backend = Backend(perception=parse_perception(HEADLINE))
        run_agents(asked.out / "main", agents, tasks, backend, asked)
        if asked.small:
            small = pooled_tasks(asked.small)
            run_agents(asked.out / "small", agents, small, backend, asked)
        run_agents(asked.out / "plus", ("3d-mem+", "msgnav+"), tasks, backend, asked)
        run_agents(asked.out / "departing", (LOOKING, DECLINING), tasks, backend, asked)
        run_agents(asked.out / "labels", RANKING_AGENTS, tasks, Backend(), asked)
        wide = Backend(perception=parse_perception(HEADLINE), simulator=SimulatorSettings(hfov_deg=120.0).component())
        run_agents(asked.out / "wide", WIDE_AGENTS, tasks, wide, asked)
        for rate in RATES:
            run_agents(asked.out / f"wrong-{rate:g}", asked.sweep_agents.split(","), subset, noisy_backend(rate), asked)
    write_parts(parts(asked.out, agents))
    sys.stdout.write(f"{PLOT}\n")


def pooled_tasks(folders: Sequence[str]) -> list[TaskFile]:
    """Tasks of all folders, each `FOLDER` or `FOLDER:LIMIT`."""
    found: list[TaskFile] = []
    for folder in folders:
        path, _, limit = folder.partition(":")
        found += task_files(Path(path), int(limit) if limit else None)
    return found


def spread(tasks: Sequence[TaskFile], num: int) -> list[TaskFile]:
    """That many of the tasks, evenly over them all."""
    num = min(num, len(tasks))
    return [tasks[index * len(tasks) // num] for index in range(num)]


def noisy_backend(rate: float) -> Backend:
    """The text matcher, of whose answers a share is another valid one."""
    return Backend(
        perception=parse_perception(HEADLINE),
        decision=Component("evonav.decision.backends:text_match", {"noise": {"wrong": rate}} if rate else {}),
    )


def parts(out: Path, agents: Sequence[str]) -> dict[str, str]:
    """The marked parts of the page, by name; draws the plot."""
    run = load_run(out / "main")
    small = [load_run(folder)] if (folder := out / "small").exists() else []
    main_table, relocation, far, first, order, differences = paper_tables(run)
    sweep = {rate: load_run(folder) for rate in RATES if (folder := out / f"wrong-{rate:g}").exists()}
    errors = ""
    if sweep:
        write_plots([_plot(sweep, agents)], PLOT)
        picture = f"![SR by share of wrong decisions](../images/{PLOT.name})"
        errors = f"{picture}\n\n{sensitivity_table(sweep, agents).markdown()}"
    return {
        "setting": setting_table(run).markdown(),
        "table-1": main_table.markdown(),
        "table-2": relocation.markdown(),
        "table-2-far": far.markdown(),
        "stage-1": first.markdown(),
        "reweighted": reweighted_table([run, *small], "procthor-10k").markdown(),
        "order": order.markdown(),
        "differences": differences.markdown(),
        "rooms": room_table(run).markdown(),
        "departures": departures.markdown() if (departures := departure_table(out, agents)).rows else "",
        "causes": "\n".join(
            f"**{title.capitalize()}**\n\n{cause_share_table(run, stratum).markdown()}"
            for stratum, title in STRATA.items()
        ),
        "ends": end_table(ends_of(run)).markdown(),
        "effort": effort_table(run).markdown(),
        "errors": errors,
    } | (small_parts(small[0]) if small else {})


def small_parts(run: RecordedRun) -> dict[str, str]:
    """The marked parts on small houses."""
    main_table, relocation, *_, differences = paper_tables(run)
    return {
        "small-setting": setting_table(run).markdown(),
        "small-1": main_table.markdown(),
        "small-2": relocation.markdown(),
        "small-differences": differences.markdown(),
    }


def write_parts(parts: Mapping[str, str]) -> None:
    """Replace marked parts of the pages of results; one whose runs are not there stays as it was."""
    for name, text in ((name, text) for name, text in parts.items() if text):
        page = next((page for page in PAGES if _mark(name) in page.read_text(encoding="utf-8")), PAGES[0])
        page.write_text(with_part(page.read_text(encoding="utf-8"), name, text), encoding="utf-8")


def with_part(page: str, name: str, text: str) -> str:
    """Return a page with one of its marked parts replaced.

    Raises:
        SystemExit: The page has no such part.
    """
    marked = re.compile(rf"({re.escape(_mark(name))}\n).*?(<!-- end of results -->)", re.DOTALL)
    if not marked.search(page):
        raise SystemExit(f"the pages of results have no part `{name}`")
    return marked.sub(lambda found: f"{found[1]}{text}{found[2]}", page, count=1)


def _mark(name: str) -> str:
    return f"<!-- results: {name} -->"


def setting_table(run: RecordedRun) -> Table:
    """Houses and stages by where the tasks come from."""
    rows = []
    groups: dict[str, list[tuple[int, int]]] = {}
    houses: dict[str, set[str]] = {}
    strata: dict[str, Counter[str]] = {}
    for task in run.tasks():
        name, house, _ = _parts_of(task.task_id)
        num_rooms = len(task.maps[1].rooms) if 1 in task.maps else 0
        groups.setdefault(name, []).append((num_rooms, task.num_stages))
        houses.setdefault(name, set()).add(house)
        counts = strata.setdefault(name, Counter())
        first = run.agents[0]
        for stage in range(1, task.num_stages + 1):
            record = task.records.get((first, stage))
            if record is not None:
                counts["first" if stage == 1 else "moved" if record.target.is_relocated else "unmoved"] += 1
    groups["all"] = [pair for part in groups.values() for pair in part]
    houses["all"] = set().union(*houses.values())
    strata["all"] = sum(strata.values(), Counter())
    for name, part in groups.items():
        rooms = [num_rooms for num_rooms, _ in part]
        counts = strata[name]
        rows.append(
            (
                name,
                str(len(houses[name])),
                str(len(part)),
                f"{min(rooms)}-{max(rooms)} (mean {sum(rooms) / len(rooms):.1f})",
                str(sum(num for _, num in part)),
                *(str(counts[stratum]) for stratum in ("first", "moved", "unmoved")),
            )
        )
    columns = ("Houses from", "houses", "tasks", "rooms", "stages", "stage 1", "relocated", "not relocated")
    config, seeds = run.config, ", ".join(sorted({_parts_of(task_id)[2] for task_id in run.num_stages}))
    note = f"Seeds of the tasks: {seeds}; of the agents: {config.get('seed', 0)}; evonav {config.get('evonav', '')}."
    return Table("Houses", columns, tuple(rows), (note,))


def room_table(run: RecordedRun) -> Table:
    """SR by size of the house."""
    group_of = {}
    for task in run.tasks():
        num_rooms = len(task.maps[1].rooms) if 1 in task.maps else 0
        group_of[task.task_id] = next((f"{a}-{b} rooms" for a, b in ROOM_GROUPS if a <= num_rooms <= b), "other")
    found = success_by_group(run, group_of)
    names = sorted(found)
    rows = tuple((agent, *(_rate(found[name].get(agent, (0, 0))) for name in names)) for agent in run.agents)
    note = "SR %, Wilson's 95% interval."
    return Table("By size of the house", ("Agent", *names), rows, (note,))


def departure_table(out: Path, agents: Sequence[str]) -> Table:
    """What our departures from the originals and from the paper are worth to the agents that have them."""
    rows = []
    for words, ours, theirs in DEPARTURES:
        if theirs[1] not in agents or not (out / ours[0]).exists():
            continue
        folders = [
            ComparedAgent(name, load_run(out / name), agent, (i, 0)) for i, (name, agent) in enumerate((ours, theirs))
        ]
        if any(one.agent not in one.run.agents for one in folders):
            continue
        (found,) = compare(folders, allow_differences=True)
        part = found.parts[0]
        success, spl = part.effects["success"], part.effects["spl"]
        rates_of = (percent(success.mean_a), percent(success.mean_b))
        rows.append((words, theirs[1], *rates_of, points(success), points(spl), str(part.n)))
    columns = ("Departure", "agent", "SR % without", "SR % with", "SR, points", "SPL, points", "n")
    return Table("Departures", columns, tuple(rows), ("With minus without, 95% bootstrap over houses, paired.",))


def sensitivity_table(sweep: dict[float, RecordedRun], agents: Sequence[str]) -> Table:
    """SR by share of wrong decisions."""
    rows = []
    for agent in agents:
        cells = []
        for run in sweep.values():
            summary = next((s for s in run.summaries if s.agent == agent), None)
            cells.append(NONE if summary is None else rate(summary.sr, summary.sr_ci95))
        if any(cell != NONE for cell in cells):
            rows.append((agent, *cells))
    columns = ("Agent", *(f"{100 * rate:g}% wrong" for rate in sweep))
    tasks = {len(run.num_stages) for run in sweep.values()}
    stages = {sum(run.num_stages.values()) for run in sweep.values()}
    note = f"SR %, {max(tasks, default=0)} houses, {max(stages, default=0)} stages; bootstrap over houses."
    return Table("Decisions that go wrong", columns, tuple(rows), (note,))


def _plot(sweep: dict[float, RecordedRun], agents: Sequence[str]) -> CurvePlot:
    lines = []
    for agent in agents:
        points = []
        for wrong, run in sweep.items():
            summary = next((s for s in run.summaries if s.agent == agent and s.sr is not None), None)
            if summary is not None and summary.sr is not None:
                points.append((100 * wrong, 100 * summary.sr, summary.sr_ci95))
        if points:
            ends = tuple(None if ci is None else (100 * ci[0], 100 * ci[1]) for _, _, ci in points)
            lines.append(Line(agent, tuple((x, y) for x, y, _ in points), ends))
    return CurvePlot("SR by share of wrong decisions", tuple(lines), "wrong decisions, %", "SR, %")


def _rate(counts: tuple[int, int]) -> str:
    successes, n = counts
    return NONE if n == 0 else f"{rate(successes / n, wilson(successes, n))}, n = {n}"


def _parts_of(task_id: str) -> tuple[str, str, str]:
    """The dataset, the house and the seed in a task's id."""
    found = re.fullmatch(r"((.*)-\d+-[0-9a-f]{6})-s(\d+)", task_id)
    return (found[2], found[1], found[3]) if found else (task_id, task_id, NONE)


def run_agents(
    out: Path, agents: Sequence[str], tasks: Sequence[TaskFile], backend: Backend, asked: argparse.Namespace
) -> None:
    """Evaluates agents on tasks into a folder, or what is left of it, with news now and then."""

    def tell(news: Progress) -> None:
        if news.latest is not None and news.num_done % 50 == 0:
            sys.stderr.write(f"{out.name}: {news.num_done} of {news.num_stages} stages\n")

    # Our own agents need no process of their own.
    config = RunConfig(seed=asked.seed, backend=backend, hosting=AgentHosting("none"))
    evaluate(agents, tasks, out, config=config, num_workers=asked.workers, on_progress=tell)


def run_parser(description: str | None, agents: Sequence[str]) -> argparse.ArgumentParser:
    """The arguments of all scripts that evaluate agents and write a page."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", nargs="+", required=True, help="folders of tasks, each with an optional :LIMIT")
    parser.add_argument("--out", type=Path, required=True, help="folder of the runs")
    parser.add_argument("--agents", default=",".join(agents))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--write-only", action="store_true", help="run nothing, write what is there")
    return parser


def _arguments() -> argparse.Namespace:
    parser = run_parser(__doc__, PAPER_ORDER)
    parser.add_argument("--sweep", type=int, default=30, help="houses of the runs with wrong decisions")
    # UniGoal takes several times as long as the others: to be asked for.
    parser.add_argument("--sweep-agents", default=",".join(PAPER_ORDER[1:]), help="agents of those runs")
    parser.add_argument("--small", nargs="*", default=(), help="folders of tasks in small houses, reported apart")
    return parser.parse_args()


if __name__ == "__main__":
    main()
