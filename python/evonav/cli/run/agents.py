"""`evonav agents`: list the agents by name."""

import typer

OWN = {
    "./file.py:Class": "a class of yours, by its file (`evonav new-agent` writes one)",
    "module:Class": "a class of yours, in an installed package",
}


def agents() -> None:
    """List the agents and oracle baselines by name."""
    from evonav.agents.registry import agent_descriptions
    from evonav.evaluation.episode.oracle_baselines import ORACLE_BASELINES

    baselines = {name: f"oracle baseline: {kind.description}" for name, kind in ORACLE_BASELINES.items()}
    for name, description in {**agent_descriptions(), **baselines, **OWN}.items():
        typer.echo(f"{name:18}{description}")
