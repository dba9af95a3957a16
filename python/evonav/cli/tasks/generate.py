"""`evonav tasks generate`: generate tasks from houses."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evonav.cli.display import generation_progress, interruptible
from evonav.cli.options.settings import POOL_KEYS, PoolSet, settings_from
from evonav.cli.options.shared import (
    AnyAsset,
    AssetFile,
    GeneratorFile,
    Limit,
    Seed,
    SomeHouses,
    StartOfHouses,
    Subset,
    Workers,
    read_houses,
)
from evonav.counted import counted

if TYPE_CHECKING:
    from evonav.generation.dataset import GenerationSummary


def generate(
    houses: SomeHouses,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder of the tasks; an unfinished one is resumed.")],
    limit: Limit = None,
    subset: Subset = None,
    seed: Seed = 0,
    config: GeneratorFile = None,
    evolve_probability: Annotated[
        float | None,
        typer.Option(
            metavar="X", help="Probability that the house changes between two stages. Default: the paper's 0.5."
        ),
    ] = None,
    num_stages: Annotated[
        str | None,
        typer.Option(
            metavar="N,N", help="Numbers of stages to draw from, separated by commas. Default: the paper's 3,4,5."
        ),
    ] = None,
    house_timeout: Annotated[
        float, typer.Option(min=1.0, metavar="X", help="Seconds before a house is given up.")
    ] = 120.0,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Try houses again for which the generator failed.")
    ] = False,
    split: Annotated[
        str | None, typer.Option(metavar="NAME", help="Name of the split to record. Default: that of the houses.")
    ] = None,
    dataset_name: Annotated[
        str | None, typer.Option(metavar="NAME", help="Name of the dataset to record. Default: that of the houses.")
    ] = None,
    allow_unknown_assets: AnyAsset = False,
    assets: AssetFile = None,
    start: StartOfHouses = "file",
    workers: Workers = None,
    set_: PoolSet = None,
) -> None:
    """Generate tasks from houses; run again to resume.

    Every house with several rooms gives a task.
    """
    from evonav.generation.config import read_parameters
    from evonav.generation.dataset import generate_dataset, inherited_names
    from evonav.generation.worker import GenerationOptions

    workforce = settings_from({"workers": workers}, set_, POOL_KEYS).workforce()
    texts = read_houses(houses, assets, start)
    dataset, inherited_split = inherited_names(texts)
    options = GenerationOptions(
        seed=seed,
        parameters=read_parameters(config, evolve_probability=evolve_probability, num_stages=num_stages),
        dataset=dataset_name or dataset,
        split=split or inherited_split,
        allow_unknown_assets=allow_unknown_assets,
    )
    with interruptible(out), generation_progress() as show:
        made = generate_dataset(
            texts,
            out,
            options=options,
            limit=limit,
            subset=subset,
            workforce=workforce,
            house_timeout_s=house_timeout,
            retry_failed=retry_failed,
            on_progress=show,
        )
    _tell(made, out)


def _tell(made: "GenerationSummary", out: Path) -> None:
    rate = f" in {made.seconds:.0f} s ({made.num_new / made.seconds:.1f} tasks/s)" if made.num_new else ""
    counts = f"{counted(len(made.roots), 'task')} in {out}, from {counted(made.num_houses, 'house')}"
    typer.echo(f"{counts}; {made.num_new} new{rate}")
    for reason, count in made.reasons.most_common():
        typer.echo(f"  {counted(count, 'house')} without a task: {reason}")
