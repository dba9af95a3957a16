"""Write the report of a controlled analysis: tables, plots, pictures of highlighted pairs, and a page of all pairs."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from evonav.controlled.analysis import (
    BASELINE,
    METRICS,
    Analysis,
    Key,
    MetricOf,
    claim_table,
    load_analysis,
    pair_tables,
)
from evonav.controlled.paired_maps import (
    ARM_WORDS,
    REASONS,
    Rollout,
    arm_title,
    change_sentence,
    describe_split,
    highlighted_pairs,
    load_pair,
    pair_frame,
    pair_svg,
    walk_and_course,
)
from evonav.controlled.rates import by_rate, rate_tables
from evonav.drawing.files import SUFFIXES
from evonav.drawing.floor_plan import furniture, ground, labels, moving_ids
from evonav.drawing.style import map_css
from evonav.drawing.svg import join, slug
from evonav.parallel.folders import write_atomically
from evonav.report.maps.legend import legend
from evonav.report.maps.text import describe_outcome
from evonav.report.maps.trajectory import change
from evonav.report.pages.task_cards import stage_cell
from evonav.report.pages.template import page_text, picture_uri, text_of
from evonav.report.plots.render import has_renderer, plot_elements, write_plots
from evonav.report.plots.specs import BarPlot, CurvePlot, Line, Plot, Series
from evonav.report.plots.style import plot_css
from evonav.report.tables.table import Table, latex_tables, markdown_tables, shortened
from evonav.statistics import ClusterBootstrap

PAGE_NAME = "index.html"
PLOT_NAMES = {"pairs": "fixed-not-fixed", "rates": "rates"}
"""Stems of the plots' files, by kind of analysis."""
PAIRS_DIR, PICTURES_DIR = "pairs", "rollouts"
HIGHLIGHTED_AGENT = "fu"
"""Agent of the paper's pictures; where it was not run, the first agent that is not the baseline."""


def tables_of(analysis: Analysis) -> list[Table]:
    """Return all tables of an analysis."""
    if analysis.record.kind == "rates":
        return rate_tables(analysis)
    return [*pair_tables(analysis), claim_table(analysis)]


def write_controlled_report(directory: Path, out: Path | None = None) -> Path:
    """Write `tables.md`, `tables.tex` and `index.html`, and with the extra `viz` the plots as SVG, PNG and PDF.

    Args:
        directory: Folder of the analysis; its runs may be unfinished.
        out: Default: its folder `report`.
    """
    out = out or directory / "report"
    analysis = load_analysis(directory)
    tables = tables_of(analysis)
    plots = controlled_plots(analysis)
    is_pairs = analysis.record.kind == "pairs"
    write_atomically(out / "tables.md", markdown_tables(tables))
    write_atomically(out / "tables.tex", latex_tables(tables))
    if has_renderer():
        for suffix in SUFFIXES:
            write_plots(plots, out / f"{PLOT_NAMES[analysis.record.kind]}{suffix}", columns=len(plots))
    page = page_text(
        "controlled.html.j2",
        text_of("report.css") + map_css() + plot_css(),
        has_drawings=True,
        name=directory.resolve().name,
        kind=analysis.record.kind,
        record=analysis.record,
        plots=plot_elements(plots, are_even=True),
        tables=shortened(tables),
        highlights=_write_highlights(analysis, out) if is_pairs else [],
        pairs=_write_pairs(analysis, out) if is_pairs else [],
        names=analysis.names,
        facts=_facts(analysis),
    )
    return write_atomically(out / PAGE_NAME, page)


def controlled_plots(analysis: Analysis) -> list[Plot]:
    """Return SR and SPL of every agent: in both arms, or over all evolution rates."""
    if analysis.record.kind == "pairs":
        return [_arm_plot(analysis, name, metric) for name, metric in METRICS.items()]
    return [_rate_plot(analysis, name, metric) for name, metric in METRICS.items()]


def _arm_plot(analysis: Analysis, name: str, metric: MetricOf) -> BarPlot:
    """Return means in both arms, over the pairs that each agent has scored."""
    groups, arm_means = [], []
    for agent in analysis.paired_agents:
        keys = analysis.keys(agent)
        groups.append(f"{analysis.names[agent]}\n({len(keys)})")
        bootstrap = ClusterBootstrap(analysis.houses(keys, agent))
        arm_means.append(bootstrap.column_means(analysis.values(agent, metric, keys)))
    series = tuple(Series.of(arm, [found[j] for found in arm_means]) for j, arm in enumerate(ARM_WORDS.values()))
    note = "in parentheses: pairs; whiskers: 95%, bootstrap by house"
    return BarPlot(f"{name}, %", tuple(groups), series, notes=(note,), y_top=100.0, has_values=True)


def _rate_plot(analysis: Analysis, name: str, metric: MetricOf) -> CurvePlot:
    found = {agent: by_rate(analysis, agent, metric) for agent in analysis.agents}
    lines = [Line.of(analysis.names[agent], by_arm) for agent, by_arm in found.items() if by_arm]
    x_label = "probability that a transition evolves the house"
    return CurvePlot(f"{name} by evolution rate", tuple(lines), x_label, f"{name}, %")


def _write_highlights(analysis: Analysis, out: Path) -> list[dict[str, str]]:
    """Draw the most instructive pairs, and return their lines of the page."""
    others = [agent for agent in analysis.agents if agent != BASELINE]
    agent = HIGHLIGHTED_AGENT if HIGHLIGHTED_AGENT in others else next(iter(others), analysis.agents[0])
    found = []
    for before in (out / PICTURES_DIR).glob("*.svg"):  # of an earlier report, when less was known
        before.unlink()
    for reason, key in highlighted_pairs(analysis, agent, per_reason=2):
        name = f"{reason}_{slug(key[0])}_{slug(agent)}.svg"
        picture = pair_svg(load_pair(analysis, agent, key))
        write_atomically(out / PICTURES_DIR / name, picture)
        found.append(
            {
                "agent": agent,
                "reason": REASONS[reason],
                "task_id": key[0],
                "page": f"{PAIRS_DIR}/{_page_name(key)}",
                "picture": picture_uri(picture),
            }
        )
    return found


def _write_pairs(analysis: Analysis, out: Path) -> list[dict[str, Any]]:
    """Write a page for each pair, and return its line in the index."""
    keys = sorted({key for found in analysis.outcomes.values() for key in found})
    lines = []
    for key in keys:
        agents = [a for a in analysis.agents if all(key in analysis.outcomes[arm, a] for arm in analysis.arms)]
        if not agents:
            continue
        values = _pair_values(analysis, agents, key)
        css = text_of("report.css") + map_css()
        page = page_text("controlled_pair.html.j2", css, has_drawings=True, **values)
        write_atomically(out / PAIRS_DIR / _page_name(key), page)
        first = analysis.outcomes[analysis.arms[0], agents[0]][key]
        cells = [
            [
                ("none", "no score")
                if (one := analysis.outcomes[arm, agent].get(key)) is None
                else (one.row.state, f"{arm_title(arm)}: {describe_outcome(one.row)}")
                for arm in analysis.arms
            ]
            for agent in analysis.agents
        ]
        lines.append(
            {
                "task_id": key[0],
                "page": f"{PAIRS_DIR}/{_page_name(key)}",
                "category": first.category,
                "change": values["change"],
                "cells": cells,
            }
        )
    return lines


def _page_name(key: Key) -> str:
    return f"{slug(key[0])}.html"


def _pair_values(analysis: Analysis, agents: Sequence[str], key: Key) -> dict[str, Any]:
    """Return the contents of a pair's page: the house once, what moved once per arm, every agent over them."""
    by_agent = {agent: load_pair(analysis, agent, key) for agent in agents}
    pair = by_agent[agents[0]]
    frame = pair_frame(pair)
    here = [one.maps[key[1]] for one in pair if key[1] in one.maps]
    moving = moving_ids(here)
    shared = ground(here[0], frame, moving) if here else ""
    defs = [f'<g class="map" id="house">{shared}</g>']
    for i, one in enumerate(pair):
        floor_plan = one.maps.get(key[1])
        items = [] if floor_plan is None else [item for item in floor_plan.objects if item.object_id in moving]
        changed = change(one.record, one.maps, frame)
        names = "" if floor_plan is None else labels(floor_plan, frame)
        defs.append(f'<g class="map" id="arm{i}">{furniture(items, frame)}{changed}</g>')
        defs.append(f'<g class="map" id="names{i}">{names}</g>')

    def cell(i: int, one: Rollout) -> dict[str, Any]:
        drawn = f'<use href="#house"/><use href="#arm{i}"/>{walk_and_course(one, frame)}<use href="#names{i}"/>'
        svg = f'<svg class="map" viewBox="{frame.view_box}" role="img">{drawn}</svg>'
        return stage_cell(one.record, Markup(svg))  # noqa: S704 - our own SVG

    first = pair[0].record
    return {
        "legend": legend(),
        "task_id": key[0],
        "change": describe_split(analysis, agents[0], key),
        "instruction": first.goal.instruction,
        "image": here[0].reference_image if here else None,
        "defs": Markup(join(defs)),  # noqa: S704 - our own SVG
        "arms": [
            {
                "words": arm_title(one.arm),
                "change": change_sentence(one),
                "is_static": one.record.transition.kind == "static",
            }
            for one in pair
        ],
        "rows": [
            (analysis.names[agent], [cell(i, one) for i, one in enumerate(found)]) for agent, found in by_agent.items()
        ],
        "commands": [f"evonav view runs/{arm} --task {key[0]}" for arm in analysis.arms],
    }


def _facts(analysis: Analysis) -> list[tuple[str, str]]:
    record = analysis.record
    rates = ",".join(f"{arm.evolve_probability:g}" for arm in record.arms)
    parts = ["evonav controlled generate --houses HOUSES --out DIR", f"--seed {record.options.seed}"]
    parts += [f"--limit {record.limit}"] if record.limit else []
    parts += [f"--per-house {record.options.per_house}"] if record.options.per_house > 1 else []
    parts += [f"--rates {rates}"] if record.kind == "rates" else []
    return [
        ("tasks", " ".join(parts)),
        ("runs", f"evonav controlled evaluate DIR --agent {','.join(analysis.agents)}"),
        ("houses", ", ".join(f"{source.name} (sha256 {source.sha256[:12]})" for source in record.sources[:20])),
        ("generation", record.options.parameters.model_dump_json()),
    ]
