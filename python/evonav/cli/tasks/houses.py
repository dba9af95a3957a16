"""`evonav houses`: list, show, check, make, compare and download houses."""

from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evonav.cli.display import house_progress, interruptible, show_tables, status
from evonav.cli.group import HELP_NAMES, Command, Group, new_app
from evonav.cli.options.settings import POOL_KEYS, PoolSet, settings_from
from evonav.cli.options.shared import (
    HOUSES,
    AnyAsset,
    AssetFile,
    Limit,
    Seed,
    StartOfHouses,
    Workers,
    listed,
    read_houses,
)
from evonav.counted import counted

if TYPE_CHECKING:
    from evonav.generation.house_statistics import HouseComparison
    from evonav.report.tables.table import Table

EXIT_WRONG = 1
LEVEL = 0.05
"""Largest adjusted p at which two sets of houses differ in a feature."""


class _ListByDefault(Group):
    """`evonav houses FILE` is `evonav houses list FILE`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401 (click's, or that of the copy in typer)
        if not args or (args[0] not in self.commands and args[0] not in HELP_NAMES["help_option_names"]):
            args = ["list", *args]
        return super().parse_args(ctx, args)


houses_app = new_app(help="List, show, check, make and compare houses, or download published ones.", cls=_ListByDefault)


@houses_app.command(name="list", cls=Command)
def list_houses(
    path: Annotated[Path | None, typer.Argument(metavar="HOUSES", help=f"Houses: {HOUSES}. Default: bundled.")] = None,
    limit: Limit = None,
) -> None:
    """List houses with their rooms, floor areas and objects."""
    from evonav.generation.house_check import area_of_m2
    from evonav.house import House

    texts = read_houses(path or "bundled", None, "file")
    texts.check_end(limit)
    typer.echo("rooms   area m2  objects  house")
    for house in (House(text, name=name) for name, text in islice(texts, limit)):
        area_m2 = sum(area_of_m2(room.polygon_m) for room in house.rooms)
        typer.echo(f"{len(house.rooms):5}  {area_m2:8.1f}  {len(house.objects):7}  {house.name}")


@houses_app.command(name="show", cls=Command)
def show_house(
    house: Annotated[
        str,
        typer.Argument(metavar="HOUSE", help=f"House: {HOUSES}; the first, or the N-th with :N, such as bundled:3."),
    ],
    assets: AssetFile = None,
    start: StartOfHouses = "file",
    allow_unknown_assets: AnyAsset = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write a page (.html) or the plan (.svg, .png, .pdf). Default: print only."),
    ] = None,
) -> None:
    """Show a house: its rooms, what is odd in it, and whether it gives a task."""
    from evonav.drawing.pictures import house_picture
    from evonav.generation.house_check import check_house, odd_note, task_outcome
    from evonav.parallel.folders import write_atomically
    from evonav.report.tasks.pages import house_page

    name, text = next(iter(read_houses(house, assets, start)))
    found = check_house(name, text, allow_unknown_assets=allow_unknown_assets)
    typer.echo(f"{name}: {found.summary}")
    for row in found.rooms:
        typer.echo(f"  {row[0]:10} {row[1]:14} {row[2]:>7} m2  {row[3]:>4} objects")
    if found.num_places:
        typer.echo(f"the agent reaches {found.num_places} places of the 0.25 m grid")
    findings = [f"{finding.severity}: {finding}" for finding in found.findings]
    if odd := odd_note(found, allow_unknown_assets=allow_unknown_assets):
        findings.append(f"note: {odd}")
    for line in findings:
        typer.echo(line)
    task = task_outcome(found, allow_unknown_assets=allow_unknown_assets)
    typer.echo(f"gives a task: {task}")
    picture = None if found.house is None else house_picture(found.house)
    if out is not None and out.suffix.lower() == ".html":
        page = house_page(
            name,
            summary=found.summary,
            task=task,
            rooms=found.rooms,
            findings=findings,
            plan_svg=None if picture is None else picture.svg,
        )
        typer.echo(f"page: {write_atomically(out, page)}")
    elif out is not None and picture is not None:
        typer.echo(f"plan: {picture.save(out)}")
    if not found.is_fine:
        raise typer.Exit(EXIT_WRONG)


@houses_app.command(name="check", cls=Command)
def check_houses(
    houses: Annotated[list[str], typer.Argument(metavar="HOUSES", help=f"Houses: {HOUSES}.")],
    assets: AssetFile = None,
    start: StartOfHouses = "file",
    allow_unknown_assets: AnyAsset = False,
    limit: Limit = None,
    only_wrong: Annotated[bool, typer.Option("--only-wrong", help="Leave out notes and houses that are fine.")] = False,
) -> None:
    """Check houses, a line each, and name what is wrong; exit code 1 if a house is."""
    from evonav.generation.house_check import check_house

    num_houses = num_wrong = 0
    opened = [read_houses(one, assets, start) for one in houses]
    for one in opened:
        one.check_end(limit)
    for name, text in islice(chain.from_iterable(opened), limit):
        found = check_house(name, text, allow_unknown_assets=allow_unknown_assets)
        num_houses, num_wrong = num_houses + 1, num_wrong + (not found.is_fine)
        if not only_wrong or not found.is_fine:
            verdict = "fine " if found.is_fine else "wrong"
            typer.echo(f"{verdict}  {name}" + ("" if found.house is None else f"  {found.summary}"))
        for finding in found.findings:
            if not only_wrong or finding.severity == "wrong":
                typer.echo(f"       {finding.severity}: {finding}")
    typer.echo(f"{num_wrong} of {counted(num_houses, 'house')} wrong")
    if num_wrong:
        raise typer.Exit(EXIT_WRONG)


@houses_app.command(name="make", cls=Command)
def make(
    out: Annotated[
        Path, typer.Option(metavar="FILE", help="File of the houses, .jsonl or .jsonl.gz; a part is resumed.")
    ],
    count: Annotated[int, typer.Option(min=1, metavar="N", help="Number of houses.")] = 100,
    seed: Seed = 0,
    first: Annotated[int, typer.Option(min=0, metavar="N", help="Number of the first house of the seed.")] = 0,
    config: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="TOML file of parameters: rooms, sizes, furniture. Default: ProcTHOR's."),
    ] = None,
    workers: Workers = None,
    set_: PoolSet = None,
) -> None:
    """Make houses from a seed, as ProcTHOR does; run again to resume."""
    from evonav.house.generated import make_houses, read_house_parameters

    parameters = read_house_parameters(config)
    with interruptible(out), house_progress(count) as show:
        made = make_houses(
            out,
            count,
            seed=seed,
            first=first,
            parameters=parameters,
            workforce=settings_from({"workers": workers}, set_, POOL_KEYS).workforce(),
            on_progress=show,
        )
    rate = f", {made.num_new / made.seconds:.1f} houses/s" if made.num_new else ""
    typer.echo(f"{counted(made.num_houses, 'house')} in {out}; {made.num_new} new{rate}")


@houses_app.command(name="stats", cls=Command)
def stats(
    a: Annotated[str, typer.Argument(metavar="A", help=f"Houses: {HOUSES}.")],
    b: Annotated[str, typer.Argument(metavar="B", help="Houses to compare them with.")],
    limit: Limit = None,
    every: Annotated[bool, typer.Option("--all", help="Print all features, not only those that differ.")] = False,
) -> None:
    """Set two sets of houses side by side, and test in what they differ.

    Houses are compared with those of the same room spec.
    """
    from evonav.generation.house_statistics import compare_houses, sample_of

    samples = []
    for name in (a, b):
        texts = read_houses(name, None, "auto")
        texts.check_end(limit)
        with status(f"Reading {name}"):
            samples.append([sample_of(text) for text in islice(texts, limit)])
    found = compare_houses(*samples)
    show_tables([comparison_table(found, (a, b), every=every)])


def comparison_table(found: "HouseComparison", names: tuple[str, str], *, every: bool) -> "Table":
    """Return the table of `evonav houses stats`: features that differ by more than chance, or all."""
    from evonav.report.tables.table import Table

    rows = [
        (one.name, f"{one.mean_a:.2f}", f"{one.mean_b:.2f}", f"{one.effect:+.2f}", f"{one.p:.3g}", f"{one.holm:.3g}")
        for one in sorted(found.features, key=lambda one: -abs(one.effect))
        if every or one.holm <= LEVEL or not one.name.startswith("number of")
    ]
    num_differing = sum(one.holm <= LEVEL for one in found.features)
    counts = " and ".join(counted(number, "house") for number in found.num_houses)
    return Table(
        title="Houses side by side",
        columns=("mean a house", "A", "B", "effect", "p", "Holm"),
        rows=tuple(rows),
        notes=(
            f"A: {names[0]}. B: {names[1]}. {counts} of {counted(len(found.strata), 'room spec')} that both have; "
            f"{found.num_left_out[0]} and {found.num_left_out[1]} of other specs are left out.",
            "Means and tests are within room specs. Effect: the difference in standard deviations within a spec.",
            f"{num_differing} of {len(found.features)} features differ (Holm at most {LEVEL:g}).",
        ),
    )


@houses_app.command(name="fetch", cls=Command)
def fetch_houses(
    dataset: Annotated[
        str,
        typer.Argument(metavar="DATASET", help="Dataset: procthor-10k, which is downloaded, or evonav-10k, made here."),
    ],
    revision: Annotated[
        str | None, typer.Option(metavar="TEXT", help="Commit, tag or branch. Default: the one for AI2-THOR 5.")
    ] = None,
    split: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SPLIT",
            help="Split: train, val or test. Repeat the option for more, or separate them by commas. Default: all.",
        ),
    ] = None,
    cache: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder of the download. Default: EVONAV_CACHE, else ~/.cache/evonav."),
    ] = None,
    workers: Workers = None,
    set_: PoolSet = None,
) -> None:
    """Download a published dataset of houses, or make that of evonav; run again to resume.

    If the houses are there already, the checksums of their files are verified.
    """
    from evonav.house import evonav10k
    from evonav.house.procthor10k import NAME, REVISION, SPLITS, fetch_procthor10k

    if dataset not in (NAME, evonav10k.NAME):
        raise typer.BadParameter(f"{dataset}: expected {NAME} or {evonav10k.NAME}")
    splits = listed(split)
    unknown = [name for name in splits if name not in SPLITS]
    if unknown:
        raise typer.BadParameter(f"--split {unknown[0]}: expected {', '.join(SPLITS)}")
    wanted = [name for name in SPLITS if not splits or name in splits]
    if dataset == evonav10k.NAME:
        if revision is not None:
            raise typer.BadParameter(f"--revision {revision}: {dataset} has none")
        for name in wanted:
            num_houses, path = evonav10k.SPLITS[name].num_houses, evonav10k.split_path(name, cache)
            state = "verified" if path.exists() else "made"
            with interruptible(path), house_progress(num_houses) as show:
                evonav10k.made_split(
                    name,
                    cache=cache,
                    workforce=settings_from({"workers": workers}, set_, POOL_KEYS).workforce(),
                    on_progress=show,
                )
            typer.echo(f"{dataset}:{name}\t{counted(num_houses, 'house')}\t{state}\t{path}")
        return
    with status(f"Fetching {NAME}") as tell:
        fetched = fetch_procthor10k(revision or REVISION, wanted, cache=cache, on_progress=tell)
    for name in wanted:
        entry = fetched.manifest.splits[name]
        state = "fetched" if name in fetched.new else "verified"
        typer.echo(f"{NAME}:{name}\t{counted(entry.num_houses, 'house')}\t{state}\t{fetched.folder / entry.file}")
