"""`evonav houses`: list and download houses."""

from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import typer

from evonav.cli.display import status
from evonav.cli.options.shared import HOUSES, Limit


class _ListByDefault(typer.core.TyperGroup):
    """`evonav houses FILE` is `evonav houses list FILE`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401 (click's, or that of the copy in typer)
        if not args or (args[0] not in self.commands and args[0] != "--help"):
            args = ["list", *args]
        return super().parse_args(ctx, args)


houses_app = typer.Typer(cls=_ListByDefault, help="List houses (the default), or download published ones.")


@houses_app.command(name="list")
def list_houses(
    path: Annotated[Path | None, typer.Argument(help=f"Houses: {HOUSES}. Default: the bundled ones.")] = None,
    limit: Limit = None,
) -> None:
    """List houses with their rooms and objects."""
    from evonav.house import bundled_houses, load_houses

    for house in islice(bundled_houses() if path is None else load_houses(path), limit):
        typer.echo(f"{house.name}\t{len(house.rooms)} rooms\t{len(house.objects)} objects")


@houses_app.command(name="fetch")
def fetch_houses(
    dataset: Annotated[str, typer.Argument(help="Dataset: procthor-10k.")],
    revision: Annotated[
        str | None, typer.Option(help="Commit, tag or branch. Default: the one for AI2-THOR 5.")
    ] = None,
    split: Annotated[
        list[str] | None, typer.Option(help="Split: train, val or test. Repeat the option for more. Default: all.")
    ] = None,
    cache: Annotated[
        Path | None, typer.Option(help="Folder of the download. Default: EVONAV_CACHE, else ~/.cache/evonav.")
    ] = None,
) -> None:
    """Download a published dataset of houses; if it is already there, verify its checksums."""
    from evonav.house.procthor10k import NAME, REVISION, SPLITS
    from evonav.house.procthor10k_fetch import fetch_procthor10k

    if dataset != NAME:
        raise typer.BadParameter(f"{dataset}: expected {NAME}")
    unknown = [name for name in split or () if name not in SPLITS]
    if unknown:
        raise typer.BadParameter(f"--split {unknown[0]}: expected {', '.join(SPLITS)}")
    wanted = [name for name in SPLITS if not split or name in split]
    with status(f"Fetching {NAME}") as tell:
        fetched = fetch_procthor10k(revision or REVISION, wanted, cache=cache, on_progress=tell)
    for name in wanted:
        entry = fetched.manifest.splits[name]
        state = "fetched" if name in fetched.new else "verified"
        typer.echo(f"{NAME}:{name}\t{entry.num_houses} houses\t{state}\t{fetched.folder / entry.file}")
