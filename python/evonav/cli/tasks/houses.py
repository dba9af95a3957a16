"""`evonav houses`: list, show, check and download houses."""

from pathlib import Path
from typing import Annotated, Any

import typer

from evonav.cli.display import status
from evonav.cli.group import HELP_NAMES, Command, Group, new_app
from evonav.cli.options.shared import (
    BUNDLED,
    HOUSES,
    AnyAsset,
    AssetFile,
    Limit,
    StartOfHouses,
    listed,
    read_houses,
)
from evonav.counted import counted

EXIT_WRONG = 1


class _ListByDefault(Group):
    """`evonav houses FILE` is `evonav houses list FILE`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401 (click's, or that of the copy in typer)
        if not args or (args[0] not in self.commands and args[0] not in HELP_NAMES["help_option_names"]):
            args = ["list", *args]
        return super().parse_args(ctx, args)


houses_app = new_app(help="List, show and check houses, or download published ones.", cls=_ListByDefault)


@houses_app.command(name="list", cls=Command)
def list_houses(
    path: Annotated[Path | None, typer.Argument(metavar="HOUSES", help=f"Houses: {HOUSES}. Default: bundled.")] = None,
    limit: Limit = None,
) -> None:
    """List houses with their rooms, floor areas and objects."""
    from evonav.generation.house_view import area_of_m2
    from evonav.house import stream_houses

    typer.echo("rooms   area m2  objects  house")
    for house in stream_houses(path or BUNDLED, limit):
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
    from evonav.generation.house_check import check_house
    from evonav.generation.house_view import house_view
    from evonav.parallel.folders import write_atomically
    from evonav.report.tasks.house_page import house_page

    name, text = next(iter(read_houses(house, assets, start)))
    view = house_view(
        check_house(name, text, allow_unknown_assets=allow_unknown_assets), allow_unknown_assets=allow_unknown_assets
    )
    typer.echo(f"{name}: {view.summary}")
    for row in view.rooms:
        typer.echo(f"  {row[0]:10} {row[1]:14} {row[2]:>7} m2  {row[3]:>4} objects")
    if view.found.num_places:
        typer.echo(f"the agent reaches {view.found.num_places} places of the 0.25 m grid")
    findings = [f"{finding.severity}: {finding}" for finding in view.found.findings]
    findings += [f"note: {view.odd}"] if view.odd else []
    for line in findings:
        typer.echo(line)
    typer.echo(f"gives a task: {view.task}")
    if out is not None and out.suffix.lower() == ".html":
        page = house_page(
            name,
            summary=view.summary,
            task=view.task,
            rooms=view.rooms,
            findings=findings,
            plan_svg=None if view.picture is None else view.picture.svg,
        )
        typer.echo(f"page: {write_atomically(out, page)}")
    elif out is not None and view.picture is not None:
        typer.echo(f"plan: {view.picture.save(out)}")
    if not view.found.is_fine:
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
    from itertools import chain, islice

    from evonav.generation.house_check import check_house
    from evonav.generation.house_view import summary_of

    num_houses = num_wrong = 0
    texts = chain.from_iterable(read_houses(one, assets, start) for one in houses)
    for name, text in islice(texts, limit):
        found = check_house(name, text, allow_unknown_assets=allow_unknown_assets)
        num_houses, num_wrong = num_houses + 1, num_wrong + (not found.is_fine)
        if not only_wrong or not found.is_fine:
            verdict = "fine " if found.is_fine else "wrong"
            typer.echo(f"{verdict}  {name}" + ("" if found.house is None else f"  {summary_of(found.house)}"))
        for finding in found.findings:
            if not only_wrong or finding.severity == "wrong":
                typer.echo(f"       {finding.severity}: {finding}")
    typer.echo(f"{num_wrong} of {counted(num_houses, 'house')} wrong")
    if num_wrong:
        raise typer.Exit(EXIT_WRONG)


@houses_app.command(name="fetch", cls=Command)
def fetch_houses(
    dataset: Annotated[str, typer.Argument(metavar="DATASET", help="Dataset: procthor-10k.")],
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
) -> None:
    """Download a published dataset of houses.

    If it was downloaded before, the checksums of its files are verified.
    """
    from evonav.house.procthor10k import NAME, REVISION, SPLITS
    from evonav.house.procthor10k_fetch import fetch_procthor10k

    if dataset != NAME:
        raise typer.BadParameter(f"{dataset}: expected {NAME}")
    splits = listed(split)
    unknown = [name for name in splits if name not in SPLITS]
    if unknown:
        raise typer.BadParameter(f"--split {unknown[0]}: expected {', '.join(SPLITS)}")
    wanted = [name for name in SPLITS if not splits or name in splits]
    with status(f"Fetching {NAME}") as tell:
        fetched = fetch_procthor10k(revision or REVISION, wanted, cache=cache, on_progress=tell)
    for name in wanted:
        entry = fetched.manifest.splits[name]
        state = "fetched" if name in fetched.new else "verified"
        typer.echo(f"{NAME}:{name}\t{counted(entry.num_houses, 'house')}\t{state}\t{fetched.folder / entry.file}")
