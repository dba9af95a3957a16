"""Running agents: `evaluate`, `demo`."""

from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evonav.cli.decision_options import (
    DecisionOptions,
    decision_component,
    decision_settings,
    print_estimate,
    print_spending,
    spelled_as_options,
    with_decision_options,
)
from evonav.cli.display import generation_progress, interruptible, print_failures, print_table, progress, status
from evonav.cli.options import (
    EXIT_INCOMPLETE,
    AgentMemory,
    AgentNames,
    AgentTimeout,
    AnyAsset,
    Engine,
    EngineOption,
    Houses,
    InProcess,
    Limit,
    ModelDevice,
    Models,
    OneAgent,
    Out,
    PerceptionName,
    RayAddress,
    Retries,
    Seed,
    SimulatorName,
    Subset,
    Tasks,
    ThorCommit,
    ThorDisplay,
    ThorExecutable,
    ThorGpu,
    ThorPlatform,
    ThorTimeout,
    Which,
    WorkerGpus,
    Workers,
    check_engine,
    count_of,
    names_of,
    perception_component,
)
from evonav.cli.view import make_pages

if TYPE_CHECKING:  # the command must start fast: everything else is imported where it is used
    from collections.abc import Iterator, Sequence

    from evonav.component import Component
    from evonav.evaluation.hosting.process import AgentHosting
    from evonav.evaluation.metrics.navigation import AgentSummary
    from evonav.evaluation.run.components import Backend
    from evonav.evaluation.run.run import RunConfig
    from evonav.tasks.listing import TaskFile
    from evonav.world.simulator import Simulator

NUM_RETRIES = 2


@with_decision_options
def evaluate(
    out: Out,
    decisions: DecisionOptions,
    agents: AgentNames = None,
    agent: OneAgent = None,
    houses: Houses = None,
    tasks: Tasks = None,
    limit: Limit = None,
    subset: Subset = None,
    seed: Seed = 0,
    perception: PerceptionName = "gt",
    models: Models = None,
    device: ModelDevice = None,
    workers: Workers = None,
    engine: Engine = EngineOption.LOCAL,
    ray_address: RayAddress = None,
    worker_gpus: WorkerGpus = 0.0,
    retries: Retries = NUM_RETRIES,
    retry_errored: Annotated[bool, typer.Option("--retry-errored", help="Run errored stages again.")] = False,
    in_process: InProcess = False,
    agent_timeout: AgentTimeout = None,
    agent_memory: AgentMemory = None,
    allow_unknown_assets: AnyAsset = False,
    simulator: Which = SimulatorName.EMBEDDED,
    thor_executable: ThorExecutable = None,
    thor_commit: ThorCommit = None,
    thor_platform: ThorPlatform = None,
    thor_gpu: ThorGpu = None,
    thor_display: ThorDisplay = None,
    thor_timeout: ThorTimeout = 100.0,
) -> None:
    """Evaluates agents on tasks; run again to resume. Leaves records.sqlite and summary.json in OUT."""
    from evonav.evaluation.run.components import Backend

    if houses is not None and tasks is not None:
        raise typer.BadParameter("give --houses or --tasks, not both")
    if limit is not None and subset is not None:
        raise typer.BadParameter("give --limit or --subset, not both")
    check_engine(engine, ray_address, worker_gpus)
    num_workers = count_of(workers)
    simulated = _simulator(
        simulator,
        allow_unknown_assets=allow_unknown_assets,
        executable=thor_executable,
        commit_id=thor_commit,
        platform=None if thor_platform is None else thor_platform.value,
        gpu_device=thor_gpu,
        x_display=thor_display,
        timeout_s=thor_timeout if simulator is SimulatorName.AI2THOR else None,
    )
    backend = Backend(simulator=simulated, perception=perception_component(perception, models, device))
    config = _config(seed, backend, decisions, out, num_workers)
    hosting = _hosting(in_process, agent_timeout or decision_settings(decisions).answer_timeout_s, agent_memory)
    config = replace(config, hosting=hosting)
    names = names_of(agents, agent)
    with _tasks(out, houses, tasks, limit, subset, seed, allow_unknown_assets, num_workers) as task_files:
        if decisions.dry_run:
            print_estimate(decisions, names, task_files, config, num_workers)
            return
        crew: dict[str, Any] = {
            "engine": engine.value,
            "ray_address": ray_address,
            "num_gpus": worker_gpus,
            "num_retries": retries,
            "retry_errored": retry_errored,
        }
        summaries = _evaluate(out, names, task_files, config, num_workers, **crew)
    print_table(summaries)
    print_failures(out)
    print_spending(out)
    _exit(summaries)


@with_decision_options
def demo(
    decisions: DecisionOptions,
    out: Out = Path("out/demo"),
    agents: AgentNames = None,
    limit: Limit = None,
    seed: Seed = 0,
    workers: Workers = None,
) -> None:
    """Evaluates the paper's three heuristics on the bundled tasks and writes a report and pages of one task."""
    from evonav.evaluation.run.components import Backend

    num_workers = count_of(workers)
    with _tasks(out, None, None, limit, None, seed, False, num_workers) as task_files:
        config = _config(seed, Backend(), decisions, out, num_workers)
        if decisions.dry_run:
            print_estimate(decisions, names_of(agents), task_files, config, num_workers)
            return
        summaries = _evaluate(out, names_of(agents), task_files, config, num_workers)
    from evonav.report import write_report

    print_table(summaries)
    print_failures(out)
    print_spending(out)
    _, index = make_pages(out)
    typer.echo(f"report: {write_report(out)}")
    typer.echo(f"round by round: {index}")
    _exit(summaries)


@contextmanager
def _tasks(
    out: Path,
    houses: Path | None,
    tasks: Path | None,
    limit: int | None,
    subset: str | None,
    seed: int,
    allow_unknown_assets: bool,
    num_workers: int,
) -> "Iterator[list[TaskFile]]":
    """The tasks of a run: given, generated into the run's folder, or bundled."""
    from evonav.generation.dataset import Workforce, generate_dataset, inherited_names
    from evonav.generation.worker import GenerationOptions
    from evonav.house.files import HouseTexts
    from evonav.tasks.bundled import bundled_tasks
    from evonav.tasks.listing import task_file, task_files

    with ExitStack() as stack:
        if houses is not None:
            texts = HouseTexts(houses)
            dataset, split = inherited_names(texts)
            options = GenerationOptions(
                seed=seed, dataset=dataset, split=split, allow_unknown_assets=allow_unknown_assets
            )
            with interruptible(out / "tasks"), generation_progress() as show:
                generated = generate_dataset(
                    texts,
                    out / "tasks",
                    options=options,
                    limit=limit,
                    subset=subset,
                    workforce=Workforce(num_workers=num_workers),
                    on_progress=show,
                )
            yield [task_file(root) for root in generated.roots]
        else:
            directory = tasks if tasks is not None else stack.enter_context(bundled_tasks())
            yield task_files(directory, limit, subset)


def _evaluate(
    out: Path,
    agents: "Sequence[str]",
    task_files: "list[TaskFile]",
    config: "RunConfig",
    num_workers: int,
    *,
    num_gpus: float = 0.0,
    **crew: Any,  # noqa: ANN401 - of `evaluate`
) -> "list[AgentSummary]":
    from evonav.evaluation.run.run import evaluate
    from evonav.parallel.worker import Resources

    with interruptible(out):
        with status("Starting the simulator"):
            config.backend.check()
        with progress() as show:
            return evaluate(
                agents,
                task_files,
                out,
                config=config,
                num_workers=num_workers,
                resources=Resources(num_gpus=num_gpus),
                on_progress=show,
                **crew,
            )


def _config(seed: int, backend: "Backend", decisions: DecisionOptions, out: Path, num_workers: int) -> "RunConfig":
    from evonav.evaluation.run.run import RunConfig

    decision = decision_component(decisions, out=out, seed=seed, num_workers=num_workers)
    config = RunConfig(seed=seed, backend=replace(backend, decision=decision))
    return replace(config, stage_timeout_s=decision_settings(decisions).stage_timeout_s)


def _hosting(in_process: bool, timeout_s: float, memory_mb: int | None) -> "AgentHosting":
    from evonav.evaluation.hosting.process import AgentHosting

    return AgentHosting(is_in_process=in_process, timeout_s=timeout_s, memory_mb=memory_mb)


def _simulator(simulator: SimulatorName, **options: Any) -> "Component[Simulator]":  # noqa: ANN401 - of `SimulatorSettings`
    """The simulator of the options; those that were not given are left to it."""
    from evonav.evaluation.run.settings import SimulatorSettings

    with spelled_as_options():
        return SimulatorSettings(kind=simulator.value, **options).component()


def _exit(summaries: "list[AgentSummary]") -> None:
    if any(summary.is_incomplete for summary in summaries):
        raise typer.Exit(EXIT_INCOMPLETE)
