"""Turn options and `--set KEY=VALUE` into settings; the keys are those of sweep files."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:  # the command must start fast
    from evonav.evaluation.run.settings import CommandSettings

MODEL_PANEL = "Decision model"
PARTS_PANEL = "Simulator, perception and workers"
FLAGS: Mapping[str, str] = {
    "simulator.kind": "--simulator",
    "simulator.allow_unknown_assets": "--allow-unknown-assets",
    "perception.make": "--perception",
    "decision.kind": "--decision",
    "decision.model": "--model",
    "decision.base_url": "--base-url",
    "prices": "--prices",
    "max_cost": "--max-cost",
    "workers": "--workers",
    "isolation": "--isolation",
}
"""Options by the key that they set; all other keys have `--set`."""
PARTS = {"SimulatorSettings": "simulator.", "PerceptionSettings": "perception.", "DecisionSettings": "decision."}
"""Beginnings of keys by the settings that have them."""
LIST = "help"
"""Value of `--set` that lists the keys."""

Simulator = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        rich_help_panel=PARTS_PANEL,
        help="embedded (evonav's own), or ai2thor (AI2-THOR through its client).",
    ),
]
Perception = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        rich_help_panel=PARTS_PANEL,
        help="gt (the truth), noisy:PRESET, predicted:STACK or module:function, with keys as in "
        "noisy:poor,miss_rate=0.3.",
    ),
]
Isolation = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        rich_help_panel=PARTS_PANEL,
        help="Where agents run: in the evaluator (none), a process, or a sandbox (without task files and network). "
        "Default: sandbox, else process.",
    ),
]
Decision = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        rich_help_panel=MODEL_PANEL,
        help="What answers the agents: text (rules), looks (rules that see colours and sizes), vlm or module:name.",
    ),
]
Model = Annotated[
    str | None,
    typer.Option(
        metavar="NAME", rich_help_panel=MODEL_PANEL, help="VLM: name of the model. Default: EVONAV_VLM_MODEL."
    ),
]
BaseUrl = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        rich_help_panel=MODEL_PANEL,
        help="VLM: address of an OpenAI-compatible API, with its /v1. Default: OPENAI_BASE_URL, else OpenAI's.",
    ),
]
Prices = Annotated[
    str | None,
    typer.Option(
        metavar="FILE",
        rich_help_panel=MODEL_PANEL,
        help='JSON file of prices in dollars per million tokens: {"MODEL": {"input_usd": 1, "output_usd": 2}}.',
    ),
]
MaxCost = Annotated[
    float | None,
    typer.Option(metavar="X", rich_help_panel=MODEL_PANEL, help="Largest cost in dollars; it needs --prices."),
]


def set_option(*prefixes: str) -> Any:  # noqa: ANN401 - typer's
    """Return the option `--set` of a command that takes the keys that begin with one of `prefixes`; default: all."""

    def complete(incomplete: str) -> list[str]:
        return [f"{key}=" for key in setting_keys(prefixes) if key.startswith(incomplete)]

    def listing(values: list[str] | None) -> list[str] | None:
        if LIST in (values or ()):
            _print_keys(prefixes)
            raise typer.Exit
        return values

    return typer.Option(
        "--set",
        metavar="KEY=VALUE",
        is_eager=True,
        callback=listing,
        autocompletion=complete,
        help=f"Any other setting; `--set {LIST}` lists them. Repeat for more.",
    )


Set = Annotated[list[str] | None, set_option()]
POOL_KEYS = ("engine", "ray_address")
PoolSet = Annotated[list[str] | None, set_option(*POOL_KEYS)]
"""Options of commands whose workers may be Ray actors."""


def settings_from(
    given: Mapping[str, Any], changes: Sequence[str] | None = None, prefixes: Sequence[str] = ()
) -> "CommandSettings":
    """Return settings from the values of options and of `--set`.

    Args:
        given: Values by key; `None` and false for options that are not given.
        changes: `KEY=VALUE`, which override the options.
        prefixes: The beginnings of the keys that `changes` may name; default: all.

    Raises:
        SettingError: A key is unknown or its value invalid.
    """
    from evonav.evaluation.run.run_settings import settings_of, unknown_key
    from evonav.evaluation.run.settings import CommandSettings
    from evonav.toml import key_and_value, set_value

    raw: dict[str, Any] = {}
    for key, value in given.items():
        if value is not None and value is not False:
            set_value(raw, key, value)
    for change in changes or ():
        key, value = key_and_value(change)
        known = setting_keys(prefixes)
        if not any(key == one or key.startswith(f"{one}.") for one in known):
            raise unknown_key(CommandSettings, key, known, f"`--set {LIST}` lists the keys")
        set_value(raw, key, value)
    return settings_of(CommandSettings, raw)


def setting_keys(prefixes: Sequence[str] = ()) -> list[str]:
    """Return the keys that `--set` takes, those of options of their own included."""
    from evonav.evaluation.run.run_settings import keys_of
    from evonav.evaluation.run.settings import CommandSettings

    return [key for key in keys_of(CommandSettings) if not prefixes or key.startswith(tuple(prefixes))]


def _print_keys(prefixes: Sequence[str]) -> None:
    """Print the keys of `--set` that have no option of their own, with what they do."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from evonav.evaluation.run.settings import CommandSettings
    from evonav.tasks.records import descriptions

    texts = descriptions(CommandSettings)
    for name, field in CommandSettings.model_fields.items():
        if isinstance(field.annotation, type) and f"{name}." in PARTS.values():
            texts |= {f"{name}.{key}": text for key, text in descriptions(field.annotation).items()}
    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(no_wrap=True)
    for key in setting_keys(prefixes):
        if key not in FLAGS:
            table.add_row(Text(key), Text(" ".join(texts.get(key, "").split())))
    Console().print(table)


def usage_error(error: Exception) -> typer.BadParameter | None:
    """Return the error of an invalid setting as wrong usage of its option; `None` for any other error."""
    from evonav.evaluation.run.run_settings import SettingError

    if not isinstance(error, SettingError):
        return None
    key = f"{PARTS.get(error.settings.__name__, '')}{error.key}"
    return typer.BadParameter(f"{FLAGS.get(key, f'--set {key}')} {error.problem}")
