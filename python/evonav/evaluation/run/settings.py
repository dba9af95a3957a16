"""A simulator, a decision model and agents' processes as people write them down, and what a run makes of them.

The command line and sweep files (`evonav.sweeps.run`) say the same things in the same words, and go this one way
to a `Backend`.
"""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import ConfigDict, Field

from evonav.component import Component
from evonav.decision.question import DecisionModel
from evonav.decision.vlm.client import Mode
from evonav.decision.vlm.ledger import LEDGER_NAME
from evonav.errors import InvalidArgumentError, StoreError
from evonav.perception import Perception
from evonav.perception.words import read_word
from evonav.tasks.records import Record
from evonav.world.simulator import Simulator

if TYPE_CHECKING:
    from evonav.decision.vlm.account import Price

EXCHANGES_NAME = "exchanges.sqlite"
"""In the folder of a run."""
MODEL_VARIABLE = "EVONAV_VLM_MODEL"
STAGE_TIMEOUT_S, VLM_STAGE_TIMEOUT_S = 900.0, 4 * 3600.0
"""The second: 50 rounds of three questions, each answered in a minute and asked again once or twice."""
ANSWER_TIMEOUT_S, VLM_ANSWER_TIMEOUT_S = 600.0, 3600.0
"""Of an agent, for a round; one whose model is asked several times in it takes its time."""

_COMPONENTS = "evonav.evaluation.run.components"
_HOST = ("gpu_device", "x_display", "timeout_s")
"""Of a simulator's settings: this machine's means, not part of what makes runs the same."""


class SettingError(InvalidArgumentError):
    """A setting that makes no sense beside the others; whoever was told it says where."""

    def __init__(self, key: str, said: str) -> None:
        """An error.

        Args:
            key: A field of the settings.
            said: What is wrong with it, to go after its name.
        """
        super().__init__(f"{key} {said}")
        self.key = key
        self.said = said


class Settings(Record):
    """Part of a file that people write: the words below a field tell what it is, in its JSON Schema too."""

    model_config = ConfigDict(use_attribute_docstrings=True)


class SimulatorSettings(Settings):
    """Which simulator runs the episodes."""

    kind: Literal["embedded", "ai2thor"] = "embedded"
    """Evonav's own, or AI2-THOR through its client (docs/ai2thor.md)."""
    allow_unknown_assets: bool = False
    """embedded: draw assets that the catalogue lacks in the usual size of their category."""
    executable: str | None = None
    """ai2thor: path of a build's executable, or `evonav`: our engine. Default: download."""
    commit_id: str | None = None
    """ai2thor: build to download. Default: the client's."""
    platform: Literal["cloud", "x11"] | None = None
    """ai2thor: Vulkan without a display, or an X display."""
    gpu_device: int | None = Field(default=None, ge=0)
    """ai2thor: GPU to draw on."""
    x_display: str | None = None
    """ai2thor: X display, such as :0. Default: DISPLAY."""
    timeout_s: float | None = Field(default=None, ge=1.0)
    """ai2thor: seconds for an answer, three times that to start; then it is restarted."""

    def component(self) -> Component[Simulator]:
        """Return how to build this simulator; what is not given is left to its own defaults.

        Raises:
            SettingError: A setting is of no use with the simulator.
        """
        given = self.model_dump(exclude={"kind", "allow_unknown_assets"}, exclude_none=True)
        if self.kind == "ai2thor":
            # Allowing unknown assets asks nothing of AI2-THOR, which has its own catalogue.
            means: dict[str, Any] = {key: given.pop(key) for key in _HOST if key in given}
            return Component(f"{_COMPONENTS}:ai2thor_simulator", given, means)
        if given:
            raise SettingError(next(iter(given)), "is for simulator ai2thor")
        return Component(f"{_COMPONENTS}:{'lenient' if self.allow_unknown_assets else 'embedded'}_simulator")


class PerceptionSettings(Settings):
    """What agents are given to see with (docs/perception.md)."""

    make: str = "gt"
    """gt (the simulator's masks and labels), noisy:PRESET (with errors), predicted:STACK (models), or
    module:function that makes a `Perception`; each with keys, as in noisy:poor,miss_rate=0.3."""
    options: dict[str, Any] = Field(default_factory=dict)
    """Keywords for it, over those of the word."""

    def component(self) -> Component[Perception]:
        """Return how to build this perception.

        Raises:
            InvalidArgumentError: There is no such perception, or a keyword makes no sense.
        """
        return read_word(self.make, self.options)


class DecisionSettings(Settings):
    """Who answers the agents' questions (docs/decision.md)."""

    kind: str = "text"
    """text (rules), vlm (a model), or module:name (your own)."""
    model: str | None = None
    """vlm: its name, as the server calls it."""
    base_url: str | None = None
    """vlm: of an OpenAI-compatible API, with its /v1. Default: OPENAI_BASE_URL, else OpenAI's."""
    mode: Mode | None = None
    """auto (default) asks what is not kept; replay never asks; record wants a new file; live keeps nothing."""
    exchanges: str | None = None
    """SQLite file of questions and answers. Default: exchanges.sqlite in the run's folder."""
    exchange_images: bool = True
    """Keep the images of exchanges too."""
    temperature: float | None = None
    """vlm: default 0.7."""
    top_p: float | None = None
    """vlm: default 0.95."""
    max_tokens: int | None = None
    """vlm: of an answer; default 4096."""
    reasoning: bool = False
    """vlm: the model knows max_completion_tokens alone, and no temperature, as OpenAI's that think first."""
    structured: Literal["auto", "on", "off"] = "auto"
    """vlm: JSON by schema; auto: until the server says that it cannot."""
    images: bool = True
    """vlm: show the model images."""
    requests_per_minute: float | None = None
    """vlm: spread over the workers."""
    tokens_per_minute: float | None = None
    """vlm: spread over the workers."""
    request_timeout_s: float | None = None
    """vlm: seconds for a try; default 60."""
    max_retries: int | None = None
    """vlm: of lost connections, 429 and 5xx; default 4."""
    noise: dict[str, float] = Field(default_factory=dict)
    """Mistakes on purpose, as shares: wrong, unparsable, refusal, lost; delay in seconds."""

    @property
    def stage_timeout_s(self) -> float:
        """How long a stage may take: models take their time."""
        return STAGE_TIMEOUT_S if self.kind == "text" else VLM_STAGE_TIMEOUT_S

    @property
    def answer_timeout_s(self) -> float:
        """How long an agent may take for a round."""
        return ANSWER_TIMEOUT_S if self.kind == "text" else VLM_ANSWER_TIMEOUT_S

    def check(self) -> None:
        """Finds what makes no sense, without asking or opening anything.

        Raises:
            SettingError: It names the setting.
            InvalidArgumentError: Rates of mistakes make no sense, or sampling is out of range.
        """
        from evonav.decision.backends import vlm_config
        from evonav.decision.noisy import NoiseRates

        NoiseRates.read(self.noise)
        if self.kind == "text":
            self._refuse_all_but("model")  # which may come from the environment
        elif self.kind == "vlm":
            identity = self.identity(0)
            vlm_config(identity["model"], identity["request"], self._server(1))
        elif ":" not in self.kind:
            raise SettingError("kind", f"{self.kind}: expected text, vlm or module:name")
        else:
            self._refuse_all_but("model", "mode", "exchanges", "exchange_images")
        if self.mode == "live" and self.exchanges is not None:
            raise SettingError("exchanges", "is of no use with mode live, which keeps nothing")

    def identity(self, seed: int) -> dict[str, Any]:
        """Options of the model that decide what it answers, part of what makes runs the same.

        Raises:
            SettingError: No model is named.
        """
        noise = {"noise": dict(self.noise)} if self.noise else {}
        if self.kind == "text":
            return noise
        if self.kind != "vlm":
            return {"path": self.kind, **noise}
        from evonav.decision.backends import SAMPLING

        model = self.model or os.environ.get(MODEL_VARIABLE)
        if not model:
            raise SettingError("model", f"is needed to ask a model (or {MODEL_VARIABLE} in the environment)")
        sampling: dict[str, Any] = {**SAMPLING, "seed": seed}
        if self.reasoning:
            sampling |= {"temperature": None, "top_p": None, "max_tokens_field": "max_completion_tokens"}
        given = _given(temperature=self.temperature, top_p=self.top_p, max_tokens=self.max_tokens)
        request = {**sampling, **given}
        return {"model": model, "structured": self.structured, "images": self.images, "request": request, **noise}

    def component(self, seed: int, books: "Books | None") -> Component[DecisionModel]:
        """Return how to build the decision model.

        Args:
            seed: Of the run.
            books: Where questions are kept and paid for; without, the model cannot be asked: for estimates.

        Raises:
            InvalidArgumentError: A setting makes no sense.
            StoreError: The exchanges cannot be opened.
        """
        self.check()
        options = self.identity(seed)
        if self.kind == "text":
            return Component("evonav.decision.backends:text_match", options)
        maker = "vlm" if self.kind == "vlm" else "own"
        path = f"evonav.decision.backends:{maker}"
        if books is None:
            return Component(path, options)
        means: dict[str, Any] = {**self._keeping(books.run_dir), "ledger": str(books.ledger.absolute())}
        if books.account:
            means["account"] = books.account
        if self.kind == "vlm":
            means |= {"server": self._server(books.num_workers), **books.spending.means(options["model"])}
        return Component(path, options, means)

    def _refuse_all_but(self, *allowed: str) -> None:
        """Says of settings that would be overlooked that they are."""
        for name in sorted(self.model_fields_set - {"kind", "noise", *allowed}):
            if getattr(self, name) != type(self).model_fields[name].default:
                raise SettingError(name, f"is of no use where {self.kind} decides")

    def _server(self, num_workers: int) -> dict[str, Any]:
        """How it is reached; each process keeps to its share of what the run may ask."""
        share = max(1, num_workers)
        requests, tokens = self.requests_per_minute, self.tokens_per_minute
        return _given(
            base_url=self.base_url,
            timeout_s=self.request_timeout_s,
            max_retries=self.max_retries,
            requests_per_minute=None if requests is None else requests / share,
            tokens_per_minute=None if tokens is None else tokens / share,
        )

    def _keeping(self, run_dir: Path) -> dict[str, Any]:
        """Where exchanges are kept, and what is had from there."""
        from evonav.decision.vlm.response_cache import ResponseCache
        from evonav.evaluation.records.store import FILE_NAME

        mode = self.mode or "auto"
        if mode == "live":
            return {}
        path = run_dir / EXCHANGES_NAME if self.exchanges is None else Path(self.exchanges)
        if mode == "replay" and not path.is_file():
            raise StoreError(f"{path}: no exchanges here to replay")
        store = ResponseCache(path)
        is_new = len(store) == 0 and store.num_failures == 0
        store.close()
        if mode == "record" and not is_new and not (run_dir / FILE_NAME).exists():
            raise StoreError(f"{path}: holds exchanges already: record to a new file, or use mode auto")
        # Agents of one run ask the same questions: the first answer has to stay, or its replay would be another run.
        kept = "auto" if mode == "record" else mode
        return {"cache": str(path.absolute()), "mode": kept, "keeps_images": self.exchange_images}


@dataclass(frozen=True, slots=True)
class SpendingSettings:
    """What models cost, and how much may be spent."""

    prices: Path | None = None
    """JSON: `{"MODEL": {"input_usd": .., "output_usd": ..}}`, dollars a million tokens."""
    max_cost_usd: float | None = None

    def price(self, model: str) -> "Price | None":
        """Of the model, from the table given.

        Raises:
            InvalidArgumentError: The table cannot be read, or lacks the model.
        """
        from evonav.decision.vlm.account import read_prices

        if self.prices is None:
            return None
        table = read_prices(self.prices)
        if model not in table:
            raise InvalidArgumentError(f"{self.prices}: has no prices of {model!r}")
        return table[model]

    def means(self, model: str) -> dict[str, Any]:
        """Keywords for what makes a model."""
        price = self.price(model)
        if self.max_cost_usd is not None and price is None:
            raise SettingError("max_cost", "needs the model's prices: name a table with prices")
        spending: dict[str, Any] = {} if price is None else {"price": [price.input_usd, price.output_usd]}
        return spending if self.max_cost_usd is None else {**spending, "max_cost_usd": self.max_cost_usd}


@dataclass(frozen=True, slots=True)
class Books:
    """Where what is asked is kept and paid for."""

    run_dir: Path
    """Exchanges are kept here, unless settings say where."""
    ledger: Path
    """File that all processes book in, of one run or of many."""
    spending: SpendingSettings = field(default_factory=SpendingSettings)
    account: str | None = None
    """Name in the ledger; default: the model's."""
    num_workers: int = 1

    @classmethod
    def of_run(cls, run_dir: Path, spending: SpendingSettings, num_workers: int) -> "Books":
        """A run with a ledger of its own."""
        return cls(run_dir, run_dir / LEDGER_NAME, spending, num_workers=num_workers)


def try_decisions(decision: Component[DecisionModel], seed: int) -> None:
    """Finds out before a run what would make all its questions fail; asks nothing.

    Raises:
        DecisionError: The model cannot be asked from here: no key, no package.
        InvalidArgumentError: It cannot be made.
    """
    check = getattr(decision.create(seed), "check", None)
    if check is not None:
        check()


def _given(**options: Any) -> dict[str, Any]:  # noqa: ANN401 - JSON
    return {name: value for name, value in options.items() if value is not None}
