"""Ground truth with simulated errors, every one of them adjustable (docs/perception.md).

What is random depends on the run's seed, the task, the stage, the round, the view and the object or place, each
through a named stream of its own; not on workers, nor on what else is seen.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evonav import _core
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.perception.noise import Confusion, NoiseConfig, PoseDrift, read_confusion
from evonav.perception.perception import Percept, Perception, StageScene
from evonav.perception.synthetic_features import DIMENSIONS, image_feature, text_feature
from evonav.sensors.observation import Detections
from evonav.world.run_images import unexpanded
from evonav.world.simulator import Frame, SceneObject

F64 = NDArray[np.float64]

_MISS, _CONFUSED, _SIMILAR, _LABEL, _CONFIDENCE, _MARGIN, _SPLIT, _WHERE, _EDGES = range(9)
"""Columns of the standard normals of an object, by what they decide; `_EDGES` is the first of four."""
_NUM_DRAWS = _EDGES + 4
_CELL_M, _STRIDE_PX = 0.25, 6
"""Places where nothing may be taken for something: edge, and spacing of the pixels looked at."""
_REFERENCE_HEIGHT_PX = 300
"""Edge of the image that margins in pixels refer to."""
_SMALLEST_QUALITY = 1e-3
_GROUND_TRUTH = GroundTruthPerception()


def noisy_perception(preset: str = "yolo-world-like", **options: Any) -> "NoisyPerception":  # noqa: ANN401 - JSON
    """Return ground truth with the errors of a preset.

    Args:
        preset: Name of a preset of `noise_presets`.
        options: Parameters of `NoiseConfig`, over the preset's.

    Raises:
        InvalidArgumentError: There is no such preset or parameter, or a value is outside its domain.
    """
    return NoisyPerception(NoiseConfig.read(preset, **options))


@dataclass(frozen=True, slots=True)
class _Found:
    """Decisions about the objects of a view, by their number in the ground truth's detections."""

    is_reported: NDArray[np.bool_]
    labels: list[str]
    confidences: F64
    draws: F64
    """`(N, _NUM_DRAWS)` standard normals."""


@dataclass(slots=True)
class NoisyPerception(Perception):
    """Ground truth through an error model. One serves one episode."""

    config: NoiseConfig = field(default_factory=NoiseConfig)
    _confusion: Confusion = field(init=False, repr=False)
    _drift: PoseDrift = field(init=False, repr=False)
    _scene: StageScene | None = field(default=None, init=False, repr=False)
    _round: int = field(default=0, init=False, repr=False)
    _lasting: dict[str, F64] = field(default_factory=dict, init=False, repr=False)
    """Draws of objects that last for the stage, by id."""

    def __post_init__(self) -> None:
        """Read the confusion matrix.

        Raises:
            InvalidArgumentError: It cannot be read.
        """
        self._confusion = read_confusion(self.config.confusion)
        self._drift = PoseDrift(self.config)

    def begin_stage(self, scene: StageScene) -> None:
        """Store the stage's objects; drift goes on."""
        self._scene = scene
        self._round = 0
        self._lasting = {}

    def change_scene(self, scene: StageScene) -> None:
        """Store the objects of the changed house; the draws of rounds and objects go on."""
        self._scene = scene

    def perceive(self, frames: Sequence[Frame]) -> list[Percept]:
        """Return each frame with its errors."""
        scene = self._stage()
        self._drift.move(frames[-1].pose, _core.draw_normals(scene.seed, [self._passing("drift")], num_draws=3)[0])
        percepts = [
            Percept(self._detect(frame, str(view)), self._depth_m(frame, str(view)), self._drift.believed(frame.pose))
            for view, frame in enumerate(frames)
        ]
        self._round += 1
        return percepts

    def text_feature(self, text: str) -> NDArray[np.float32] | None:
        """Return the feature of the categories that the text names, where detections have features."""
        return text_feature(text, self._confusion) if self.config.features else None

    def _stage(self) -> StageScene:
        assert self._scene is not None, "begin_stage comes first"
        return self._scene

    def _lasting_labels(self, *labels: str) -> list[str]:
        """Return the labels of a stream that is the same in all views."""
        scene = self._stage()
        stage = str(scene.goal.stage) if self.config.persistence_scope == "stage" else ""
        return ["lasting", scene.task_id, stage, *labels]

    def _passing(self, *labels: str) -> list[str]:
        """Return the labels of a stream of this round alone."""
        scene = self._stage()
        return ["passing", scene.task_id, str(scene.goal.stage), str(self._round), *labels]

    def _draws(self, view: str, ids: Sequence[str]) -> F64:
        """Return `(N, _NUM_DRAWS)` standard normals of objects in a view, correlated over the views of an object."""
        seed, share = self._stage().seed, self.config.persistence
        new = [one for one in dict.fromkeys(ids) if one not in self._lasting]
        drawn = _core.draw_normals(seed, [self._lasting_labels("object", one) for one in new], num_draws=_NUM_DRAWS)
        self._lasting.update(zip(new, drawn, strict=True))
        passing = [self._passing("object", view, one) for one in ids]
        lasting = np.array([self._lasting[one] for one in ids]).reshape(-1, _NUM_DRAWS)
        fresh = _core.draw_normals(seed, passing, num_draws=_NUM_DRAWS)
        return math.sqrt(share) * lasting + math.sqrt(1.0 - share) * fresh

    def _detect(self, frame: Frame, view: str) -> Detections:
        """Return the detections of a view, numbered by their first pixel."""
        objects = self._stage().objects
        runs, instances = _GROUND_TRUTH.number(frame, objects)
        truth = runs.pixels()
        bodies = [objects[index] for index in instances]
        outlines = _core.mask_outlines(truth, frame.depth_m, num_masks=len(bodies))
        extents = _core.mask_extents(runs, num_masks=len(bodies))
        found = self._found(view, bodies, outlines, extents[:, 0] / truth.size)
        labels, sources = list(found.labels), list(range(len(bodies)))
        masks = self._masks(truth, extents, found, sources, view, bodies)
        labels = [found.labels[source] for source in sources]
        confidences = [float(found.confidences[source]) for source in sources]
        phantoms = self._phantoms(frame, masks, view, len(labels))
        labels += [label for label, _, _ in phantoms]
        confidences += [confidence for _, confidence, _ in phantoms]
        # Renumbered, so that neither numbers nor order tell how a detection came about.
        numbered, order = _core.number_instances(
            masks + 1,
            np.ones(len(labels), np.bool_),
            min_area_px=_GROUND_TRUTH.min_px(frame),
            max_box_fraction=1.0,
        )
        features = None
        if self.config.features:
            features = self._features(found, sources, view, bodies, [what for _, _, what in phantoms], labels)
            features = features[order]
        return Detections(
            masks=unexpanded(numbered),
            labels=tuple(labels[number] for number in order),
            confidences=np.array([confidences[number] for number in order], np.float32),
            features=features,
        )

    def _found(self, view: str, bodies: Sequence[SceneObject], outlines: F64, areas: F64) -> _Found:
        """Decide which objects are found, with which label, and with what confidence."""
        config = self.config
        draws = self._draws(view, [body.id for body in bodies])
        shares = _shares(draws)
        visible = 1.0 - outlines[:, 1] / np.maximum(outlines[:, 0], 1.0)
        half_m = config.half_distance_m
        distances = outlines[:, 2] / half_m if half_m else np.zeros(len(bodies))
        quality = (
            _falling(config.half_area_fraction / np.maximum(areas, 1e-9), config.area_slope)
            * _falling(distances, config.distance_slope)
            * _falling(config.half_visible / np.maximum(visible, 1e-9), config.visible_slope)
        )
        is_found = shares[:, _MISS] < (1.0 - config.miss_rate) * quality
        is_confused = shares[:, _CONFUSED] < config.confusion_rate
        is_similar = shares[:, _SIMILAR] < config.confusion_similar
        draws_of_labels = zip(is_confused.tolist(), is_similar.tolist(), shares[:, _LABEL].tolist(), strict=True)
        labels = [
            self._confusion.another(body.category, similar, share) if confused else body.category
            for body, (confused, similar, share) in zip(bodies, draws_of_labels, strict=True)
        ]
        medians = np.where(is_confused, config.false_confidence, config.confidence)
        confidences = _confidences(medians, quality, draws[:, _CONFIDENCE], config)
        is_reported = is_found & (confidences >= config.confidence_threshold)
        return _Found(is_reported, labels, confidences, draws)

    def _masks(
        self,
        truth: NDArray[np.int32],
        extents: NDArray[np.int64],
        found: _Found,
        sources: list[int],
        view: str,
        bodies: Sequence[SceneObject],
    ) -> NDArray[np.int32]:
        """Return masks with their errors; parts of split masks are added to `sources`, the object of each mask."""
        config = self.config
        numbers = np.where(found.is_reported, np.arange(len(bodies)), -1)
        shares = _shares(found.draws)
        _, left, top, right, bottom = extents.T
        edge_shifts = config.box_jitter * found.draws[:, _EDGES : _EDGES + 4]
        wide, high = right - left, bottom - top
        changes = np.empty((len(bodies), 8), np.int32)
        changes[:, 0] = changes[:, 1] = numbers
        is_wide = wide > high
        changes[:, 2] = is_wide
        at = 0.3 + 0.4 * shares[:, _WHERE]
        changes[:, 3] = np.where(is_wide, left + at * wide, top + at * high).astype(np.int32)
        for number in np.flatnonzero(found.is_reported & (shares[:, _SPLIT] < config.split_rate)).tolist():
            changes[number, 1] = len(sources)
            sources.append(number)
        margins = config.mask_margin_px + config.mask_margin_spread_px * found.draws[:, _MARGIN]
        margins = np.clip(margins * truth.shape[0] / _REFERENCE_HEIGHT_PX, -32.0, 32.0)
        # Sides that move outwards cut nothing, not even what the mask gains.
        edges = zip((top, left, bottom, right), (high, wide, high, wide), (1, 1, -1, -1), edge_shifts.T, strict=True)
        for column, (edge, length, inwards, moved) in enumerate(edges, 4):
            cut = np.clip(moved, 0.0, 0.45) * length
            outside = 0 if inwards > 0 else np.iinfo(np.int32).max
            changes[:, column] = np.where(cut >= 0.5, edge + inwards * np.round(cut), outside)
        if config.merge_rate > 0.0:
            self._merge(truth, changes, found, view, bodies)
        return _core.distort_masks(truth, changes, margins)

    def _merge(
        self,
        truth: NDArray[np.int32],
        changes: NDArray[np.int32],
        found: _Found,
        view: str,
        bodies: Sequence[SceneObject],
    ) -> None:
        """Give one number to some masks that lie side by side with the same label."""
        pairs = [
            (a, b)
            for a, b in _beside(truth)
            if found.is_reported[a] and found.is_reported[b] and found.labels[a] == found.labels[b]
        ]
        ids = [sorted((bodies[a].id, bodies[b].id)) for a, b in pairs]
        seed, share = self._stage().seed, self.config.persistence
        lasting = _core.draw_normals(seed, [self._lasting_labels("merge", *pair) for pair in ids], num_draws=1)
        passing = _core.draw_normals(seed, [self._passing("merge", view, *pair) for pair in ids], num_draws=1)
        draws = math.sqrt(share) * lasting + math.sqrt(1.0 - share) * passing
        for (a, b), merged in zip(pairs, (_shares(draws)[:, 0] < self.config.merge_rate).tolist(), strict=True):
            if merged:
                gone, stays = int(changes[b, 0]), int(changes[a, 0])
                parts = changes[:, :2]
                parts[parts == gone] = stays

    def _phantoms(
        self, frame: Frame, masks: NDArray[np.int32], view: str, first: int
    ) -> list[tuple[str, float, tuple[str, str]]]:
        """Paint false detections into the masks; return label, confidence, and names of lasting and passing draws."""
        config, scene = self.config, self._stage()
        if config.false_positives_per_view == 0.0 or frame.instances is None:
            return []
        pixels, values = _core.surface_sites(
            frame,
            cell_m=_CELL_M,
            stride_px=max(1, round(_STRIDE_PX * frame.intrinsics.height_px / _REFERENCE_HEIGHT_PX)),
            persistence=config.persistence,
            seed=scene.seed,
            lasting=self._lasting_labels("place"),
            passing=self._passing("place", view),
        )
        if not len(pixels):
            return []
        rate = min(config.false_positives_per_view / len(pixels), 1.0 - 1e-9)
        is_seen = values[:, 1] < NormalDist().inv_cdf(rate)
        pixels, (depth_m, _, what, size, how) = pixels[is_seen], values[is_seen].T
        medians = np.full(len(pixels), config.false_confidence)
        confidences = _confidences(medians, np.ones(len(pixels)), how, config)
        is_sure = confidences >= config.confidence_threshold
        # Between half and twice the median.
        radii_px = config.false_positive_radius_m * 2.0 ** (2.0 * size - 1.0) * frame.intrinsics.focal_px / depth_m
        numbers = first + np.arange(int(is_sure.sum()))
        _core.paint_blobs(
            masks,
            frame.instances,
            np.column_stack([pixels[is_sure], numbers]).astype(np.int64),
            np.repeat(np.maximum(radii_px[is_sure], 1.0)[:, None], 2, axis=1),
        )
        labels = [self._confusion.frequent(share) for share in what[is_sure].tolist()]
        names = [
            (f"{share:.17g}", f"{row},{col}") for share, (row, col) in zip(what[is_sure], pixels[is_sure], strict=True)
        ]
        return list(zip(labels, confidences[is_sure].tolist(), names, strict=True))

    def _features(
        self,
        found: _Found,
        sources: Sequence[int],
        view: str,
        bodies: Sequence[SceneObject],
        places: Sequence[tuple[str, str]],
        labels: Sequence[str],
    ) -> NDArray[np.float32]:
        """Return the `(N, D)` features of objects, parts of objects and false detections."""
        label_sets = [tuple(dict.fromkeys((bodies[n].category, found.labels[n]))) for n in sources]
        label_sets += [(label,) for label in labels[len(sources) :]]
        task_id = self._stage().task_id
        things = [["feature", "object", task_id, bodies[n].id] for n in sources]
        things += [["feature", "place", task_id, lasting] for lasting, _ in places]
        views = [self._passing("feature", view, bodies[n].id, str(i)) for i, n in enumerate(sources)]
        views += [self._passing("feature", view, passing) for _, passing in places]
        of_things = _core.draw_normals(0, things, num_draws=DIMENSIONS - 2)
        of_views = _core.draw_normals(self._stage().seed, views, num_draws=DIMENSIONS - 2)
        rows = [
            image_feature(label_set, self._confusion, thing, one, self.config.feature_noise)
            for label_set, thing, one in zip(label_sets, of_things, of_views, strict=True)
        ]
        return np.array(rows, np.float32).reshape(-1, DIMENSIONS)

    def _depth_m(self, frame: Frame, view: str) -> NDArray[np.float32]:
        config = self.config
        noise = {
            "sigma_m": config.depth_sigma_m,
            "sigma_per_m": config.depth_sigma_per_m,
            "step_per_m": config.depth_step_per_m,
            "dropout": config.depth_dropout,
            "edge_dropout": config.depth_edge_dropout,
        }
        if not any(noise.values()) and config.depth_range_m == 0.0:
            return frame.depth_m
        reach_m = config.depth_range_m or math.inf
        labels = self._passing("depth", view)
        return _core.noisy_depth(frame.depth_m, **noise, max_depth_m=reach_m, seed=self._stage().seed, labels=labels)


def _shares(normals: F64) -> F64:
    """Return standard normals as uniform numbers in 0..1."""
    flat = [0.5 * math.erfc(-value / math.sqrt(2.0)) for value in normals.ravel().tolist()]
    return np.array(flat).reshape(normals.shape)


def _falling(ratios: F64, slope: float) -> F64:
    """Return 1 where `ratios` are 0, 0.5 where they are 1, and less where they are larger."""
    return 1.0 / (1.0 + ratios**slope)


def _confidences(medians: F64, quality: F64, normals: F64, config: NoiseConfig) -> F64:
    """Draw confidences around the medians, lower for objects that are hard to see; a median of 1 stays 1."""
    with np.errstate(divide="ignore"):
        odds = np.log(medians) - np.log1p(-medians) + np.log(np.maximum(quality, _SMALLEST_QUALITY))
    values = 1.0 / (1.0 + np.exp(-(odds + config.confidence_spread * normals)))
    return np.where(medians == 1.0, 1.0, values)


def _beside(masks: NDArray[np.int32]) -> list[tuple[int, int]]:
    """Return the pairs of masks with adjacent pixels, each once, the lower number first."""
    count = int(masks.max()) + 1
    keys = []
    for here, there in ((masks[:, :-1], masks[:, 1:]), (masks[:-1], masks[1:])):
        differ = (here != there) & (here >= 0) & (there >= 0)
        a, b = here[differ].astype(np.int64), there[differ].astype(np.int64)
        keys.append(np.minimum(a, b) * count + np.maximum(a, b))
    return [divmod(int(key), count) for key in np.unique(np.concatenate(keys))] if count > 1 else []
