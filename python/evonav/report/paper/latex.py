"""Write the paper's Tables 1 and 2 with a run's numbers as LaTeX in the paper's layout, the paper's numbers in grey."""

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

from evonav.counted import counted
from evonav.evaluation.metrics.navigation import Rates
from evonav.report.paper.tables import NUM_STAGES, PAPER, PaperResult, Perception
from evonav.report.run import RecordedRun
from evonav.report.tables.numbers import rate
from evonav.report.tables.table import latex_text, short_names

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


class _Line(NamedTuple):
    """A line of a table: one measure of every agent."""

    name: str
    split: str = "all"
    measure: Literal["sr", "spl"] = "sr"

    def ours(self, run: RecordedRun | None) -> dict[str, Rates]:
        """Return the rates of a run's agents that have the measure."""
        found = {} if run is None else {one.agent: one.rates(self.split) for one in run.summaries}
        return {agent: rates for agent, rates in found.items() if getattr(rates, self.measure) is not None}

    def papers(self, known: PaperResult) -> float:
        """Return the paper's value."""
        return known.sr(self.split) if self.measure == "sr" else known.spl


MAIN = (_Line(r"SR $\uparrow$"), _Line(r"SPL $\uparrow$", measure="spl"))
RELOCATION = (_Line("Relocated", "relocated"), _Line("Not Relocated", "not_relocated"))


def paper_latex(runs: Mapping[Perception, RecordedRun]) -> str:
    """Return both tables as `table` environments; every number with n and interval in a comment.

    Args:
        runs: Runs by perception; agents that the paper lacks come last, settings without a run show the paper alone.
    """
    sizes = latex_text("; ".join(f"{SETTINGS[setting]}: {_run_size(run)}" for setting, run in runs.items()))
    main = rf"\textbf{{Main results}} of evaluated baselines and heuristic strategies. {sizes}. Grey: as published."
    relocation = rf"\textbf{{Impact of target relocation}} on the success rate (SR). {sizes}. Grey: as published."
    return "\n".join(
        [
            PREAMBLE,
            *(f"% evonav paper: {run.run_dir.as_posix()}".replace("\n", " ") for run in runs.values()),
            *_table(runs, MAIN, ("Setting", "Metric"), main, "tab:main-results"),
            "",
            *_table(runs, RELOCATION, ("Perception", "Target Status"), relocation, "tab:relocation-results"),
            "",
        ]
    )


def _table(
    runs: Mapping[Perception, RecordedRun], rows: Sequence[_Line], heads_of: tuple[str, str], caption: str, label: str
) -> list[str]:
    agents = dict.fromkeys(agent for run in runs.values() for agent in run.agents)
    names = NAMES | {agent: latex_text(name) for agent, name in short_names(agents).items()}
    groups = [
        ("Evaluated Baselines", BASELINES),
        ("Heuristic Strategies", HEURISTICS),
        ("Other Agents", tuple(agent for agent in agents if agent not in NAMES)),
    ]
    groups = [(title, members) for title, members in groups if members]
    heads, rules, shown, start = [], [], [], 3
    columns = "ll"
    for title, members in groups:
        # Beside each of the paper's agents stands, in grey, what the paper has.
        widths = [2 if member in NAMES else 1 for member in members]
        heads.append(rf"\multicolumn{{{sum(widths)}}}{{c}}{{\textbf{{{title}}}}}")
        rules.append(rf"\cmidrule(lr){{{start}-{start + sum(widths) - 1}}}")
        shown += [
            rf"\multicolumn{{2}}{{c}}{{{NAMES[member]}}}" if member in NAMES else names.get(member, latex_text(member))
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
        " & ".join([*(rf"\multirow{{2}}{{*}}{{\textbf{{{head}}}}}" for head in heads_of), *heads]) + r" \\",
        "".join(rules),
        "& & " + " & ".join(shown) + r" \\",
    ]
    for setting, title in SETTINGS.items():
        lines.append(r"\midrule")
        for i, row in enumerate(rows):
            ours = row.ours(runs.get(setting))
            lines += _comments(title, row, {agent: ours[agent] for agent in order if agent in ours})
            head = rf"\multirow{{{len(rows)}}}{{*}}{{\textbf{{{title}}}}}" if i == 0 else ""
            values = {agent: getattr(rates, row.measure) for agent, rates in ours.items()}
            published = {agent: row.papers(known) for agent, known in PAPER[setting].items()}
            lines.append(" & ".join([head, row.name, *_cells(values, published, order)]) + r" \\")
    return [*lines, r"\bottomrule", r"\end{tabular}", r"\end{table}"]


def _cells(values: Mapping[str, float], published: Mapping[str, float], order: Sequence[str]) -> list[str]:
    """Return ours and, beside it, the paper's value of each agent; the best of both are bold."""
    best, best_published = max(values.values()) if len(values) > 1 else None, max(published.values())
    cells = []
    for agent in order:
        value = values.get(agent)
        text = "--" if value is None else f"{100 * value:.1f}"
        cells.append(rf"\textbf{{{text}}}" if value is not None and value == best else text)
        if agent in NAMES:
            theirs = f"{100 * published[agent]:.1f}"
            cells.append(rf"\textbf{{{theirs}}}" if published[agent] == best_published else theirs)
    return cells


def _comments(setting: str, row: _Line, ours: Mapping[str, Rates]) -> list[str]:
    name = row.name.partition(" $")[0]
    return [
        f"% {setting}, {name}, {' '.join(agent.split())}: "
        f"{rate(getattr(found, row.measure), getattr(found, f'{row.measure}_ci95'))}, n = {found.n}"
        + (f"; paper n = {NUM_STAGES[row.split]}" if agent in NAMES else "")
        for agent, found in ours.items()
    ]


def _run_size(run: RecordedRun) -> str:
    """Describe the size of a run, and whether it is complete."""
    num_stages = sum(run.num_stages.values())
    part = ", incomplete" if any(summary.is_incomplete for summary in run.summaries) else ""
    return f"{counted(len(run.num_stages), 'task')}, {counted(num_stages, 'stage')}{part}"
