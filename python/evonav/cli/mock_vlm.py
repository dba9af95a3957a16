"""`evonav mock-vlm`: serve a simulated model, to test runs that ask one."""

from typing import Annotated

import typer

from evonav.counted import counted


def mock_vlm(
    port: Annotated[int, typer.Option(min=0, max=65535, metavar="N", help="Port; 0 takes any free one.")] = 8000,
    faults: Annotated[
        str,
        typer.Option(
            metavar="NAME=RATE",
            help="Share of requests that fail, such as refusal=0.1,rate_limit=0.05; names: see above.",
        ),
    ] = "",
    schemas: Annotated[
        bool,
        typer.Option(help="Accept JSON Schemas and follow them; with --no-schemas reject them, as some servers do."),
    ] = True,
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Seed that decides which requests fail.")] = 0,
    latency: Annotated[float, typer.Option(min=0.0, metavar="X", help="Seconds before each answer.")] = 0.0,
) -> None:
    """Serve a simulated model, to test runs that ask one.

    It has an OpenAI-compatible API on this machine and answers by rules. Faults: rate_limit (429 with Retry-After),
    server_error (500), hang, disconnect, malformed (broken JSON around the answer), broken_json (in it), truncated,
    refusal, filtered, empty, off_topic.
    """
    import time

    from evonav.decision.noisy import read_rates
    from evonav.decision.vlm.mock_answers import mock_answer
    from evonav.decision.vlm.mock_server import FAULTS, MockServer, faulty, serving, without_schemas

    def answer(request: dict[str, object]) -> str:
        time.sleep(latency)
        return mock_answer(request)

    server = MockServer(faulty(read_rates(faults, list(FAULTS)), seed, answer))
    server.requests = None
    if not schemas:
        server.check = without_schemas
    with serving(server, port=port):
        typer.echo(f"serving {server.url}; in another terminal:")
        typer.echo(f"  evonav evaluate --decision vlm --model mock --base-url {server.url} --limit 1 --out out/mock")
        try:
            while True:
                time.sleep(3600.0)
        except KeyboardInterrupt:
            typer.echo(f"{counted(server.num_requests, 'request')} served")
