"""Write the paper's Tables 1 and 2 with a run's numbers as LaTeX in the paper's layout, the paper's numbers in grey."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from evonav.counted import counted
from evonav.evaluation.metrics.navigation import Rates
from evonav.report.paper.tables import NUM_STAGES, PAPER, PaperResult, Perception
from evonav.report.run import RecordedRun
from evonav.report.tables.numbers import rate
from evonav.report.tables.table import latex_text

NAMES = {
    "unigoal": "UniGoal",
    "3d-mem": "3D-Mem",
    "msgnav": "MSGNav",
    "fu": "FU",
    "stage-reset": "Stage-Reset",
    "ftu": "FTU",
}
BASELINES, HEURISTICS = ("unigoal", "3d-mem", "msgnav"), ("fu", "stage-reset", "ftu")
SETTINGS: dict[Perception, str] = {"gt": "GT", "prediction": "Prediction"}
PREAMBLE = r"% Needs \usepackage{array,booktabs,multirow,xcolor}."


@dataclass(frozen=True, slots=True)
class _Row:
    """A line of a table: one measure of every agent."""

    name: str
    ours: Mapping[str, Rates]
    measure: str
    """`sr` or `spl`."""
    paper: Mapping[str, float]
    num_paper: int


def paper_latex(runs: Mapping[Perception, RecordedRun]) -> str:
    """Return both tables as `table` environments; every number with n and interval in a comment.

    Args:
        runs: Runs by perception; agents that the paper lacks come last, settings without a run show the paper alone.
    """
    agents = list(dict.fromkeys(agent for run in runs.values() for agent in run.agents))
    main: dict[Perception, list[_Row]] = {}
    relocation: dict[Perception, list[_Row]] = {}
    for setting in SETTINGS:
        row = partial(_row, runs.get(setting), PAPER[setting])
        main[setting] = [row(r"SR $\uparrow$"), row(r"SPL $\uparrow$", measure="spl")]
        relocation[setting] = [row("Relocated", "relocated"), row("Not Relocated", "not_relocated")]
    sizes = latex_text("; ".join(f"{SETTINGS[setting]}: {_run_size(run)}" for setting, run in runs.items()))
    grey = "Grey: as published."
    return "\n".join(
        [
            PREAMBLE,
            *(f"% evonav paper: {run.run_dir.as_posix()}".replace("\n", " ") for run in runs.values()),
            *_table(
                main,
                agents,
                "Setting",
                "Metric",
                rf"\textbf{{Main results}} of evaluated baselines and heuristic strategies. {sizes}. {grey}",
                "tab:main-results",
            ),
            "",
            *_table(
                relocation,
                agents,
                "Perception",
                "Target Status",
                rf"\textbf{{Impact of target relocation}} on the success rate (SR). {sizes}. {grey}",
                "tab:relocation-results",
            ),
            "",
        ]
    )


def _table(
    settings: Mapping[Perception, Sequence[_Row]],
    agents: Sequence[str],
    first: str,
    second: str,
    caption: str,
    label: str,
) -> list[str]:
    groups = [
        ("Evaluated Baselines", BASELINES),
        ("Heuristic Strategies", HEURISTICS),
        ("Other Agents", tuple(agent for agent in agents if agent not in NAMES)),
    ]
    groups = [(title, members) for title, members in groups if members]
    heads, rules, names, start = [], [], [], 3
    columns = "ll"
    for title, members in groups:
        # Beside each of the paper's agents stands, in grey, what the paper has.
        widths = [2 if member in NAMES else 1 for member in members]
        heads.append(rf"\multicolumn{{{sum(widths)}}}{{c}}{{\textbf{{{title}}}}}")
        rules.append(rf"\cmidrule(lr){{{start}-{start + sum(widths) - 1}}}")
        names += [
            rf"\multicolumn{{2}}{{c}}{{{NAMES[member]}}}" if member in NAMES else latex_text(member)
            for member in members
        ]
        columns += "".join(r"c>{\color{gray}}c" if width == 2 else "c" for width in widths)
        start += sum(widths)
    order = [member for _, members in groups for member in members]
    lines = [
        r"\begin{table}[t]",
        r"\centering",
        rf"\caption{{{caption}}}",
        rf"\label{{{label}}}",
        r"\small",
        r"\setlength{\tabcolsep}{3pt}",
        rf"\begin{{tabular}}{{@{{}}{columns}@{{}}}}",
        r"\toprule",
        rf"\multirow{{2}}{{*}}{{\textbf{{{first}}}}} & \multirow{{2}}{{*}}{{\textbf{{{second}}}}} & "
        + " & ".join(heads)
        + r" \\",
        "".join(rules),
        "& & " + " & ".join(names) + r" \\",
    ]
    for setting, rows in settings.items():
        lines.append(r"\midrule")
        for i, row in enumerate(rows):
            lines += _comments(setting, row, order)
            head = rf"\multirow{{{len(rows)}}}{{*}}{{\textbf{{{SETTINGS[setting]}}}}}" if i == 0 else ""
            lines.append(" & ".join([head, row.name, *_cells(row, order)]) + r" \\")
    return [*lines, r"\bottomrule", r"\end{tabular}", r"\end{table}"]


def _cells(row: _Row, order: Sequence[str]) -> list[str]:
    values = {agent: _value(row.ours[agent], row.measure) for agent in order if agent in row.ours}
    known = [value for value in values.values() if value is not None]
    best = max(known, default=None) if len(known) > 1 else None
    best_paper = max(row.paper.values())
    cells = []
    for agent in order:
        value = values.get(agent)
        text = "--" if value is None else f"{100 * value:.1f}"
        cells.append(rf"\textbf{{{text}}}" if value is not None and value == best else text)
        if agent in NAMES:
            theirs = f"{100 * row.paper[agent]:.1f}"
            cells.append(rf"\textbf{{{theirs}}}" if row.paper[agent] == best_paper else theirs)
    return cells


def _comments(setting: Perception, row: _Row, order: Sequence[str]) -> list[str]:
    lines = []
    for agent in order:
        found = row.ours.get(agent)
        if found is not None and found.n:
            interval = found.sr_ci95 if row.measure == "sr" else found.spl_ci95
            name = row.name.split(" $", maxsplit=1)[0]
            lines.append(
                f"% {SETTINGS[setting]}, {name}, {' '.join(agent.split())}: "
                f"{rate(_value(found, row.measure), interval)}, n = {found.n}"
                + (f"; paper n = {row.num_paper}" if agent in NAMES else "")
            )
    return lines


def _row(
    run: RecordedRun | None, paper: Mapping[str, PaperResult], name: str, split: str = "all", *, measure: str = "sr"
) -> _Row:
    ours = {} if run is None else {summary.agent: summary.rates(split) for summary in run.summaries}
    theirs = {agent: known.sr(split) if measure == "sr" else known.spl for agent, known in paper.items()}
    return _Row(name, ours, measure, theirs, NUM_STAGES[split])


def _value(found: Rates, measure: str) -> float | None:
    return found.sr if measure == "sr" else found.spl


def _run_size(run: RecordedRun) -> str:
    """Describe the size of a run, and whether it is complete."""
    num_stages = sum(run.num_stages.values())
    part = ", incomplete" if any(summary.is_incomplete for summary in run.summaries) else ""
    return f"{counted(len(run.num_stages), 'task')}, {counted(num_stages, 'stage')}{part}"
