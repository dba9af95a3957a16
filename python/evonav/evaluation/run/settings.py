"""Declare the options of a run's parts, once for Python, sweep files and commands (`run_settings`: of its workers).

Sweep files and the options of commands are validated by these models. Each model builds a `Component`.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from evonav.component import Component
from evonav.decision.goal_input import GoalInput
from evonav.decision.question import DecisionModel
from evonav.decision.vlm.caching_client import Mode
from evonav.errors import StoreError
from evonav.evaluation.protocol import ProtocolConfig
from evonav.evaluation.run.components import USUAL_CAMERA, Backend
from evonav.evaluation.run.run_settings import (
    DecisionResources,
    RunSettings,
    SettingError,
    Settings,
    SpendingSettings,
)
from evonav.perception import Perception
from evonav.perception.shorthand import PREDICTED, parse_perception
from evonav.world.ai2thor.startup import Ai2ThorOptions
from evonav.world.simulator import Simulator, SimulatorConfig, Style

if TYPE_CHECKING:
    from evonav.decision.options import AskedOptions, VlmOptions
    from evonav.evaluation.run.run import RunConfig

EXCHANGES_NAME = "exchanges.sqlite"
"""File of questions and answers in the folder of a run."""
MODEL_VARIABLE = "EVONAV_VLM_MODEL"
"""Environment variable with the default of `DecisionSettings.model`."""
STAGE_TIMEOUT_S, VLM_STAGE_TIMEOUT_S = 900.0, 4 * 3600.0
"""Time limit of a stage. A model may need a minute for each of three questions in 50 rounds, and be asked again."""
ANSWER_TIMEOUT_S, VLM_ANSWER_TIMEOUT_S = 600.0, 3600.0
"""Time limit of an agent's answer in one round, in which a model may be asked several times."""

_COMPONENTS = "evonav.evaluation.run.components"
_SIMULATOR_HOST_OPTIONS = ("gpu_device", "x_display", "timeout_s")
"""Settings of AI2-THOR that depend on this machine."""


class SimulatorSettings(Ai2ThorOptions, Settings):
    """The simulator that runs the episodes, and the options of AI2-THOR."""

    kind: Literal["embedded", "ai2thor"] = "embedded"
    """Simulator: embedded (evonav's own) or ai2thor (AI2-THOR through its client)."""
    style: Style | None = None
    """Embedded: style of colours: plain or default. Default: default."""
    width_px: int | None = Field(default=None, ge=32, le=4096)
    """Width of camera images in pixels. Default: 300."""
    height_px: int | None = Field(default=None, ge=32, le=4096)
    """Height of camera images in pixels. Default: 300."""
    hfov_deg: float | None = Field(default=None, ge=30.0, le=150.0)
    """Horizontal field of view of the camera in degrees. Default: 90."""
    allow_unknown_assets: bool = False
    """Give assets that are missing from the catalogue the usual size of their category."""

    def component(self) -> Component[Simulator]:
        """Return the component of this simulator; options that are not given keep its own defaults.

        Raises:
            SettingError: An option does not apply to the simulator.
        """
        name = "ai2thor" if self.kind == "ai2thor" else "lenient" if self.allow_unknown_assets else "embedded"
        path = f"{_COMPONENTS}:{name}_simulator"
        given = self.model_dump(include=set(Ai2ThorOptions.model_fields), exclude_defaults=True)
        if self.kind == "ai2thor":
            # AI2-THOR has a catalogue of its own, so that allow_unknown_assets changes nothing.
            if self.style is not None:
                raise SettingError(type(self), "style", "is for simulator embedded")
            host_options = {key: given.pop(key) for key in _SIMULATOR_HOST_OPTIONS if key in given}
            return Component(path, {**given, **self._camera()}, host_options)
        if given:
            raise SettingError(type(self), next(iter(given)), "is for simulator ai2thor")
        return Component(path, {"style": self.style or SimulatorConfig().style, **self._camera()})

    def _camera(self) -> Mapping[str, Any]:
        """Return the options of the camera, where they are not the usual ones."""
        given = self.model_dump(include=set(USUAL_CAMERA), exclude_none=True)
        return {key: value for key, value in given.items() if value != USUAL_CAMERA[key]}


class PerceptionSettings(Settings):
    """The perception that turns camera images into what agents see (docs/perception.md)."""

    make: str = "gt"
    """Perception of the agents.

    gt (the simulator's masks and labels), noisy:PRESET (with simulated errors), predicted:STACK (models) or
    module:function (your own), with keys as in noisy:poor,miss_rate=0.3."""
    options: dict[str, Any] = Field(default_factory=dict)
    """Keyword arguments of the perception; they override the keys in its name."""
    models: str | None = None
    """Predicted perception: folder of the models' weights. Default: EVONAV_MODELS, else download them."""
    device: str | None = None
    """Predicted perception: device of the models: auto, cpu, cuda or cuda:N. Default: auto."""

    def component(self) -> Component[Perception]:
        """Return the component of this perception.

        Raises:
            SettingError: `models` or `device` is given without predicted perception.
            InvalidArgumentError: There is no such perception, or a keyword is invalid.
        """
        host_options = _given(models=self.models and str(Path(self.models).absolute()), device=self.device)
        found = parse_perception(
            self.make, {**self.options, **(host_options if self.make.startswith("predicted") else {})}
        )
        if host_options and found.path != PREDICTED:
            raise SettingError(type(self), next(iter(host_options)), "is for perception predicted")
        return found


RULES: Mapping[str, str] = {"text": "text_match", "looks": "appearance_match"}
"""Decision models that ask nobody, and the functions in `evonav.decision.backends` that make them."""


class DecisionSettings(Settings):
    """The decision model that answers the agents' questions (docs/decision.md)."""

    kind: str = "text"
    """Decision model that answers the agents' questions.

    text (rules), looks (rules that see colours and sizes), vlm (a vision-language model on a server) or
    module:name (your own)."""
    model: str | None = None
    """VLM: name of the model on the server. Default: EVONAV_VLM_MODEL."""
    base_url: str | None = None
    """VLM: address of an OpenAI-compatible API, with its /v1. Default: OPENAI_BASE_URL, else OpenAI's."""
    mode: Mode | None = None
    """VLM: auto asks what is not stored yet, replay never asks, record needs a new file, live stores nothing.
    Default: auto."""
    exchanges: str | None = None
    """SQLite file that stores questions and answers. Default: exchanges.sqlite in the run's folder, if any."""
    exchange_images: bool = True
    """Store the images of questions too."""
    temperature: float | None = None
    """VLM: sampling temperature. Default: 0.7."""
    top_p: float | None = None
    """VLM: probability mass for nucleus sampling. Default: 0.95."""
    max_tokens: int | None = None
    """VLM: largest number of tokens in an answer. Default: 4096."""
    reasoning: bool = False
    """VLM: send max_completion_tokens and no temperature, as OpenAI's reasoning models expect."""
    structured: Literal["auto", "on", "off"] = "auto"
    """VLM: request JSON by schema (on), never (off), or until the server rejects it (auto)."""
    images: bool = True
    """VLM: show images to the model."""
    requests_per_minute: float | None = None
    """VLM: largest number of requests per minute, shared by all workers. Default: no limit."""
    tokens_per_minute: float | None = None
    """VLM: largest number of tokens per minute, shared by all workers. Default: no limit."""
    request_timeout_s: float | None = None
    """VLM: seconds to wait for one answer. Default: 60."""
    max_retries: int | None = None
    """VLM: number of retries after a lost connection, status 429 or a server error. Default: 4."""
    tell_of_change: bool = False
    """Tell the model in every prompt that things may have been moved; the paper's agents are not informed."""
    goal_input: GoalInput = "text"
    """Form of the goal for agents: the sentence (text, as in the paper), reference image and category (image), or both.

    image and both need a model that sees: looks or vlm."""
    noise: dict[str, float] = Field(default_factory=dict)
    """Rates of simulated mistakes, from 0 to 1: wrong, confused, unparsable, refusal, lost; and delay in seconds."""
    eagerness: float = 0.0
    """looks: from 0 to 1, go to objects that are less likely the goal."""
    mistakes: float = 0.0
    """looks: temperature at which objects are drawn by how likely they are; 0 takes the likeliest."""

    @property
    def asks_rules(self) -> bool:
        """Whether rules decide, which need no network and have no costs."""
        return self.kind in RULES

    @property
    def time_limits(self) -> dict[str, float]:
        """Limits of a stage and of an agent's answer in a round, by name; longer where a model is asked."""
        if self.asks_rules:
            return {"stage_timeout_s": STAGE_TIMEOUT_S, "answer_timeout_s": ANSWER_TIMEOUT_S}
        return {"stage_timeout_s": VLM_STAGE_TIMEOUT_S, "answer_timeout_s": VLM_ANSWER_TIMEOUT_S}

    def named_model(self) -> str:
        """Return the name of the model on the server; `SettingError` if none is named."""
        model = self.model or os.environ.get(MODEL_VARIABLE)
        if not model:
            raise SettingError(
                type(self), "model", f"is needed to ask a model (or {MODEL_VARIABLE} in the environment)"
            )
        return model

    def check(self) -> None:
        """Check the settings without asking or opening anything.

        Raises:
            SettingError: A setting is invalid or does not apply.
            InvalidArgumentError: A rate of mistakes or a sampling parameter is out of range.
        """
        from evonav.decision.noisy import NoiseRates

        if NoiseRates(**self.noise).confused and not self.asks_rules:
            raise SettingError(type(self), "noise", "confused needs the scores of rules: decision text or looks")
        if self.goal_input != "text" and (self.kind == "text" or not self.images):
            raise SettingError(type(self), "goal_input", f"{self.goal_input}: needs looks, or vlm with images")
        if self.kind == "text":
            self._refuse_all_but("model")
        elif self.kind == "looks":
            from evonav.decision.rules import AppearanceMatch

            self._refuse_all_but("model", "eagerness", "mistakes", "goal_input")
            AppearanceMatch(eagerness=self.eagerness, mistakes=self.mistakes)
        elif self.kind == "vlm":
            self._refuse_all_but(*type(self).model_fields.keys() - {"eagerness", "mistakes"})
            _ = self._vlm(0).model_copy(update={"server": self._server(1)}).config
        elif ":" not in self.kind:
            raise SettingError(type(self), "kind", f"{self.kind}: expected text, looks, vlm or module:name")
        else:
            self._refuse_all_but("model", "mode", "exchanges", "exchange_images", "tell_of_change", "goal_input")
        if self.mode == "live" and self.exchanges is not None:
            raise SettingError(type(self), "exchanges", "is of no use with mode live, which stores nothing")

    def identity(self, seed: int) -> dict[str, Any]:
        """Return the options that decide the answers, part of a run's identity; `SettingError` if no model is named."""
        changed: dict[str, Any] = {"noise": dict(self.noise)} if self.noise else {}
        if self.goal_input != "text":
            changed["goal_input"] = self.goal_input
        if self.kind == "text":
            return changed
        if self.kind == "looks":
            return {"eagerness": self.eagerness, "mistakes": self.mistakes, **changed}
        return self._asked(seed).identity()

    def _asked(self, seed: int) -> "AskedOptions":
        """Return the options of a model that is asked by prompts, as far as they do not depend on files."""
        from evonav.decision.options import CustomOptions

        return self._vlm(seed) if self.kind == "vlm" else CustomOptions(path=self.kind, **self._prompting())

    def _vlm(self, seed: int) -> "VlmOptions":
        from evonav.decision.options import SAMPLING, VlmOptions

        sampling: dict[str, Any] = {**SAMPLING, "seed": seed}
        if self.reasoning:
            sampling |= {"temperature": None, "top_p": None, "max_tokens_field": "max_completion_tokens"}
        given = _given(temperature=self.temperature, top_p=self.top_p, max_tokens=self.max_tokens)
        return VlmOptions(
            model=self.named_model(),
            structured=self.structured,
            images=self.images,
            request={**sampling, **given},
            **self._prompting(),
        )

    def _prompting(self) -> dict[str, Any]:
        noise = dict(self.noise) or None
        return {"tells_of_change": self.tell_of_change, "goal_input": self.goal_input, "noise": noise}

    def component(self, seed: int, resources: DecisionResources | None) -> Component[DecisionModel]:
        """Return the component of this decision model.

        Args:
            resources: The files for answers and costs; without them the model cannot be asked, which is
                enough for estimates.

        Raises:
            InvalidArgumentError: A setting is invalid.
            StoreError: The file of exchanges cannot be opened.
        """
        self.check()
        if self.asks_rules:
            return Component(f"evonav.decision.backends:{RULES[self.kind]}", self.identity(seed))
        path = f"evonav.decision.backends:{'vlm' if self.kind == 'vlm' else 'custom'}"
        options = self._asked(seed)
        if resources is None:
            return Component(path, options.identity())
        files: dict[str, Any] = {
            **self._response_cache(resources.run_dir),
            "ledger": str(resources.spending_log.absolute()),
            "account": resources.account or None,
        }
        if self.kind == "vlm":
            files["server"] = self._server(resources.num_askers)
            files |= resources.spending.host_options(self.named_model())
        return Component(path, options.identity(), options.model_copy(update=files).host())

    def _refuse_all_but(self, *allowed: str) -> None:
        """Reject settings that would be ignored."""
        for name in sorted(self.model_fields_set - {"kind", "noise", *allowed}):
            if getattr(self, name) != type(self).model_fields[name].default:
                raise SettingError(type(self), name, f"is of no use where {self.kind} decides")

    def _server(self, num_askers: int) -> dict[str, Any]:
        """Return how the server is reached; each episode that runs has an equal share of the rate limits."""
        share = max(1, num_askers)
        requests, tokens = self.requests_per_minute, self.tokens_per_minute
        return _given(
            base_url=self.base_url,
            timeout_s=self.request_timeout_s,
            max_retries=self.max_retries,
            requests_per_minute=None if requests is None else requests / share,
            tokens_per_minute=None if tokens is None else tokens / share,
        )

    def _response_cache(self, run_dir: Path) -> dict[str, Any]:
        """Return where answers are stored, and how the stored ones are used."""
        from evonav.decision.vlm.caching_client import ResponseCache
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
        # Agents of one run ask the same questions: the first answer is stored for all, or a replay would differ.
        return {
            "cache": str(path.absolute()),
            "mode": "auto" if mode == "record" else mode,
            "keeps_images": self.exchange_images,
        }


class CommandSettings(RunSettings, SpendingSettings):
    """The settings of one run, as a command's options give them; the keys are those of sweep files."""

    simulator: SimulatorSettings = SimulatorSettings()
    perception: PerceptionSettings = PerceptionSettings()
    decision: DecisionSettings = DecisionSettings()

    def run_config(
        self, seed: int, out: Path, protocol: ProtocolConfig | None = None, *, asks_model: bool = True
    ) -> "RunConfig":
        """Return the configuration of a run, after a check that its decision model can be asked from here.

        Args:
            seed: Seed of every random choice.
            out: Folder of the run, which stores answers and costs.
            protocol: Default: the paper's.
            asks_model: True if the model can be asked; estimates do without.

        Raises:
            InvalidArgumentError: A setting is invalid.
            DecisionError: The model cannot be asked from here: a key or package is missing.
            StoreError: The file of exchanges cannot be opened.
        """
        resources = DecisionResources.of_run(out, self, self.num_episodes) if asks_model else None
        backend = Backend(
            simulator=self.simulator.component(),
            perception=self.perception.component(),
            decision=self.decision.component(seed, resources),
        )
        if asks_model and not self.decision.asks_rules:
            backend.decision.create(seed).check()
        return self.config(seed, backend, protocol, **self.decision.time_limits)


def _given(**options: Any) -> dict[str, Any]:  # noqa: ANN401 - JSON
    return {name: value for name, value in options.items() if value is not None}
