"""Perceive with a stack of models, named on the command line and loaded once in each process.

A stack is put together from models, filters and the words that they look for.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

from pydantic import Field

from evonav.errors import InvalidArgumentError
from evonav.perception.detector import Detector, DetectorView, Embedder, Found
from evonav.perception.detector_perception import DetectorPerception
from evonav.perception.filters import FilterConfig, filtered, joined
from evonav.perception.models import libraries
from evonav.perception.models.prompted import BoxFinder, MaskMaker, PromptedDetector
from evonav.perception.models.torchvision_models import MaskRcnn
from evonav.perception.perception import Perception, StageScene
from evonav.perception.vocabulary import COCO_UNIGOAL, DINO_UNIGOAL, VOCABULARIES
from evonav.perception.weights import Weights, check_folder, fingerprint, known, located, models_folder
from evonav.records import Options, Share

StackName = Literal["3d-mem", "unigoal", "transformers"]
STACKS: tuple[StackName, ...] = get_args(StackName)

EVERYTHING = FilterConfig(
    background=(),
    min_area_fraction=0.0,
    min_confidence=0.0,
    max_mask_iou=1.0,
    min_centre_distance_px=0.0,
    min_area_px=0.0,
    max_box_fraction=1.0,
    min_share_of_inner=1.0,
)
"""Filters that drop empty masks alone."""
UNIGOAL_GRAPH = EVERYTHING.model_copy(update={"reference_px": (480, 640), "min_area_px": 25.0, "max_box_fraction": 0.5})
"""UniGoal's, of its scene graph; it looks at 640x480."""
_SAME_IOU = 0.5
"""UniGoal's two detectors: masks that overlap by more are one object, and the map's detector names it."""
_COCO = {{"plant": "potted plant"}.get(word, word): word for word in COCO_UNIGOAL}
"""UniGoal's word by COCO's category."""


_Words = Annotated[str, Field(pattern=r"\S")]


class StackConfig(Options):
    """Options of the stacks; each takes those that it has models for, and `None` is the published value."""

    of = "predicted perception"
    vocabulary: _Words | None = None
    """`procthor` (default), `scannet200`, or words with semicolons between them; unigoal has its own."""
    min_confidence: Share | None = None
    """Least confidence of detections; 3d-mem 0.4, transformers 0.3, unigoal 0.5 (Mask R-CNN), 0.3 (Grounding DINO)."""
    detector: _Words | None = None
    """Weights of the detector: 3d-mem yolov8x-world.pt, transformers google/owlv2-base-patch16-ensemble."""
    sam: _Words | None = None
    """Weights of SAM: 3d-mem sam_l.pt, transformers facebook/sam-vit-large, unigoal facebook/sam-vit-huge."""
    min_mask_score: Share | None = None
    """Least score of SAM's masks; unigoal 0.95, the others accept all."""
    swapped_colours: bool = False
    """3d-mem: show detector and SAM red as blue and blue as red, as 3D-Mem's released code does."""

    @property
    def phrases(self) -> tuple[str, ...]:
        """Words that an open-vocabulary detector looks for."""
        name = self.vocabulary or "procthor"
        for known_name, phrases in VOCABULARIES.items():
            if name == known_name:
                return phrases
        phrases = tuple(dict.fromkeys(word.strip().lower() for word in name.split(";") if word.strip()))
        if not phrases or (len(phrases) == 1 and name in (*STACKS, "coco", "scannet")):
            raise InvalidArgumentError(
                f"predicted perception: no vocabulary {name!r}; there are {', '.join(VOCABULARIES)}, or words with "
                "semicolons between them"
            )
        return phrases


@dataclass(frozen=True, slots=True)
class JointDetector:
    """UniGoal's two detectors as one: Mask R-CNN for its map, Grounded-SAM for its scene graph."""

    network: MaskRcnn
    min_confidence: float
    grounded: Detector

    def detect(self, views: Sequence[DetectorView]) -> list[Found]:
        """Join the detections of both; of a thing that both found, take the map's word, which every table knows."""
        firsts = self.network.detect([view.rgb for view in views], _COCO, self.min_confidence)
        seconds = self.grounded.detect(views)
        return [
            joined(filtered(first, EVERYTHING), filtered(second, UNIGOAL_GRAPH), _SAME_IOU)
            for first, second in zip(firsts, seconds, strict=True)
        ]


def stack_of(agent: str) -> StackName:
    """Return the stack that `auto` means for an agent."""
    return "unigoal" if agent.startswith("unigoal") else "3d-mem"


def weights_of(stack: StackName, config: StackConfig) -> dict[str, Weights]:
    """Return the weights that a stack loads, by part.

    Raises:
        PerceptionError: An option names weights that are not known.
        InvalidArgumentError: An option is none of this stack's.
    """
    defaults: dict[StackName, dict[str, str]] = {
        "3d-mem": {
            "detector": "yolov8x-world.pt",
            "text": "timm/vit_base_patch32_clip_224.openai",
            "sam": "sam_l.pt",
            "clip": "laion/CLIP-ViT-B-32-laion2B-s34B-b79K",
        },
        "unigoal": {
            "network": "maskrcnn_resnet50_fpn_coco-bf2d0c1e.pth",
            "detector": "IDEA-Research/grounding-dino-tiny",
            "sam": "facebook/sam-vit-huge",
        },
        "transformers": {
            "detector": "google/owlv2-base-patch16-ensemble",
            "sam": "facebook/sam-vit-large",
            "clip": "laion/CLIP-ViT-B-32-laion2B-s34B-b79K for transformers",
        },
    }
    if stack == "unigoal" and config.vocabulary is not None:
        raise InvalidArgumentError("predicted:unigoal has words of its own; leave vocabulary out")
    if stack != "3d-mem" and config.swapped_colours:
        raise InvalidArgumentError(f"predicted:{stack}: swapped_colours is of 3d-mem")
    names = {**defaults[stack], **({"detector": config.detector} if config.detector else {})}
    names |= {"sam": config.sam} if config.sam else {}
    for part, name in names.items():
        if ("/" in name) != ("/" in defaults[stack][part]):
            library = "ultralytics" if stack == "3d-mem" else "transformers"
            raise InvalidArgumentError(f"predicted:{stack}: {part} is {name!r}, expected weights of {library}")
    return {part: known(name) for part, name in names.items()}


def modules_of(stack: StackName) -> tuple[str, ...]:
    """Return the modules that a stack imports."""
    return {
        "3d-mem": ("torch", "open_clip", "ultralytics"),
        "unigoal": ("torch", "torchvision", "transformers"),
        "transformers": ("torch", "torchvision", "transformers"),
    }[stack]


def facts_of(stack: StackName, config: StackConfig, models: str | None) -> dict[str, Any]:
    """Return what decides a stack's results besides its options: hashes of weights and versions of libraries.

    Raises:
        PerceptionError: A library or a file is missing, or a file is not what it should be.
        InvalidArgumentError: An option makes no sense.
    """
    config.phrases  # noqa: B018 - may raise
    folder = models_folder(models)
    weights = list(weights_of(stack, config).values())
    versions = libraries.versions_of(modules_of(stack), "yolo" if stack == "3d-mem" else "torch")
    if folder is not None:
        check_folder(weights, folder)
    return {"libraries": versions, "weights": {k: v for one in weights for k, v in fingerprint(one, folder).items()}}


def load_stack(
    stack: StackName, config: StackConfig, models: str | None, device: str
) -> tuple[Detector, FilterConfig, Embedder | None]:
    """Load a stack's models; a model that this process has loaded before is not loaded again.

    Args:
        device: `auto`, `cpu`, `cuda` or `cuda:N`.

    Raises:
        PerceptionError: A library, a file or the device is missing, or a file cannot be loaded.
        InvalidArgumentError: An option makes no sense.
    """
    phrases = config.phrases
    folder = models_folder(models)
    paths = {part: str(located(one, folder)) for part, one in weights_of(stack, config).items()}
    on = libraries.device_of(device)
    if stack == "3d-mem":
        from evonav.perception.models import open_clip_models, ultralytics_models

        published = 0.4
        finder: BoxFinder = ultralytics_models.load_yolo_world(paths["detector"], paths["text"], on)
        masker: MaskMaker = ultralytics_models.load_ultralytics_sam(paths["sam"], on)
        embedder: Embedder = open_clip_models.load_open_clip("ViT-B-32", paths["clip"], on)
    else:
        from evonav.perception.models import transformers_models

        masker = transformers_models.Sam.load(paths["sam"], on)
        if stack == "unigoal":
            from evonav.perception.models.torchvision_models import load_mask_rcnn

            finder = transformers_models.GroundingDino.load(paths["detector"], on)
            min_score, min_confidence = _either(config.min_mask_score, 0.95), _either(config.min_confidence, 0.3)
            least = _either(config.min_confidence, 0.5)
            network = load_mask_rcnn(paths["network"], on, min(least, 0.05))
            grounded = PromptedDetector(finder, masker, DINO_UNIGOAL, min_confidence, min_score)
            return JointDetector(network, least, grounded), EVERYTHING, None
        published = 0.3
        finder = transformers_models.Owlv2.load(paths["detector"], on)
        embedder = transformers_models.Clip.load(paths["clip"], on)
    min_confidence = _either(config.min_confidence, published)
    detector = PromptedDetector(
        finder,
        masker,
        phrases,
        min_confidence,
        _either(config.min_mask_score, -math.inf),
        swaps_colours=config.swapped_colours,
    )
    return detector, FilterConfig(min_confidence=min_confidence), embedder


def _either(given: float | None, published: float) -> float:
    return published if given is None else given


class StackPerception(DetectorPerception):
    """A stack by its name; its models are loaded at the first stage, once a process."""

    def __init__(self, stack: str, config: StackConfig, models: str | None, device: str) -> None:
        """Store the options; for them see `predicted_perception`."""
        self._stack, self._config, self._models, self._device = stack, config, models, device

    def check(self, agents: Sequence[str]) -> dict[str, Any]:
        """Check that everything needed is there, without loading it; missing files are fetched.

        Args:
            agents: Agents that will use it.

        Returns:
            What decides results besides options: by stack, hashes of weights and versions of libraries.

        Raises:
            PerceptionError: Something is missing; the message says what to do.
            InvalidArgumentError: An option makes no sense.
        """
        stacks = sorted({self._stack_for(agent) for agent in agents})
        facts: dict[str, Any] = {stack: facts_of(stack, self._config, self._models) for stack in stacks}
        libraries.device_of(self._device)
        return facts

    def begin_stage(self, scene: StageScene) -> None:
        """Load the models of the agent's stack; of the scene, only the agent's name is used."""
        super().__init__(*load_stack(self._stack_for(scene.agent), self._config, self._models, self._device))

    def _stack_for(self, agent: str) -> StackName:
        return next((name for name in STACKS if name == self._stack), None) or stack_of(agent)


def predicted_perception(
    stack: str = "auto",
    models: str | None = None,
    device: str = "auto",
    **options: Any,  # noqa: ANN401 - of `StackConfig`
) -> Perception:
    """Make the perception `predicted[:STACK]`.

    Args:
        stack: One of `evonav.perception.shorthand.STACKS`; `auto`: UniGoal's for UniGoal, 3D-Mem's for all others.
        models: Folder of weights; default: `EVONAV_MODELS`, else the libraries' own hubs.
        device: `auto`, `cpu`, `cuda` or `cuda:N`.
        options: See `StackConfig`; of `mini`, which needs neither models nor a device,
            `evonav.perception.mini.MiniConfig`, and of `coco` `evonav.perception.coco.CocoConfig`.

    Raises:
        InvalidArgumentError: There is no such stack or option.
    """
    if stack == "mini":
        from evonav.perception.mini import MiniConfig, mini_perception

        return mini_perception(MiniConfig(**options))
    if stack == "coco":
        from evonav.perception.coco import CocoConfig, coco_perception

        if device not in ("auto", "cpu"):
            raise InvalidArgumentError(f"predicted:coco computes on the processor, not on {device!r}: leave device out")
        return coco_perception(models, CocoConfig(**options))
    if stack != "auto" and stack not in STACKS:
        raise InvalidArgumentError(f"no stack {stack!r}; there are auto, {', '.join(STACKS)}, mini, coco")
    return StackPerception(stack, StackConfig(**options), models, device)
