"""`evonav houses`: list and download houses."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evonav.cli.display import status
from evonav.cli.group import HELP_NAMES, Command, Group, new_app
from evonav.cli.options.shared import BUNDLED, HOUSES, Limit, listed

if TYPE_CHECKING:
    from collections.abc import Sequence


class _ListByDefault(Group):
    """`evonav houses FILE` is `evonav houses list FILE`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401 (click's, or that of the copy in typer)
        if not args or (args[0] not in self.commands and args[0] not in HELP_NAMES["help_option_names"]):
            args = ["list", *args]
        return super().parse_args(ctx, args)


houses_app = new_app(help="List houses, or download published ones.", cls=_ListByDefault)


@houses_app.command(name="list", cls=Command)
def list_houses(
    path: Annotated[Path | None, typer.Argument(metavar="HOUSES", help=f"Houses: {HOUSES}. Default: bundled.")] = None,
    limit: Limit = None,
) -> None:
    """List houses with their rooms, floor areas and objects."""
    from evonav.house import load_houses

    typer.echo("rooms   area m2  objects  house")
    for house in load_houses(path or BUNDLED, limit):
        area_m2 = sum(_area_m2(room.polygon_m) for room in house.rooms)
        typer.echo(f"{len(house.rooms):5}  {area_m2:8.1f}  {len(house.objects):7}  {house.name}")


def _area_m2(outline_m: "Sequence[tuple[float, float]]") -> float:
    """Return the area that an outline encloses."""
    following = zip(outline_m, [*outline_m[1:], *outline_m[:1]], strict=True)
    return abs(sum(x0 * z1 - x1 * z0 for (x0, z0), (x1, z1) in following)) / 2.0


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
    """Download a published dataset of houses, or verify the checksums of the downloaded files."""
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
        typer.echo(f"{NAME}:{name}\t{entry.num_houses} houses\t{state}\t{fetched.folder / entry.file}")
