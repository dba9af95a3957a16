"""Parameters, presets, confusion and features of simulated perception."""

import math
from pathlib import Path

import numpy as np
import pytest

from evonav import _core
from evonav.errors import InvalidArgumentError
from evonav.evaluation.run.components import load_spec
from evonav.perception.noise import NoiseConfig, noise_presets, read_confusion
from evonav.perception.simulated import noisy_perception
from evonav.perception.synthetic_features import DIMENSIONS, image_feature, nouns_of, text_feature
from evonav.tasks.listing import BUNDLED_TASKS


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"miss_rate": 1.5}, "noisy: miss_rate = 1.5: Input should be less than or equal to 1"),
        ({"miss_rate": math.nan}, "miss_rate = nan: Input should be a finite number"),
        ({"miss_rate": "much"}, "miss_rate = 'much': Input should be a valid number"),
        ({"area_slope": 0}, "area_slope = 0: Input should be greater than 0"),
        ({"depth_range_m": -1}, "depth_range_m = -1: Input should be greater than or equal to 0"),
        ({"mask_margin_px": -30}, "mask_margin_px = -30: Input should be greater than or equal to -20"),
        ({"false_positives_per_view": 51}, "false_positives_per_view = 51: Input should be less than or equal to 50"),
        ({"features": 1}, "features = 1: Input should be a valid boolean"),
        ({"persistence_scope": "run"}, "persistence_scope = 'run': Input should be 'stage' or 'episode'"),
        ({"mis_rate": 0.1}, "noisy has no option 'mis_rate'; did you mean miss_rate?"),
        ({"preset": "bad"}, "no preset 'bad'; there are perfect, good, yolo-world-like, poor"),
        ({"confusion": "nowhere.toml"}, "nowhere.toml: cannot be read"),
    ],
)
def test_bad_parameters_are_named(options: dict[str, object], said: str) -> None:
    with pytest.raises(InvalidArgumentError) as error:
        noisy_perception(**options)  # type: ignore[arg-type]
    assert said in str(error.value)


def test_presets_are_what_the_file_says_with_options_over_them() -> None:
    assert noise_presets()["perfect"] == NoiseConfig()
    poor = NoiseConfig.read("poor", miss_rate=0.5)
    assert poor.miss_rate == 0.5
    assert poor.depth_sigma_per_m == noise_presets()["poor"].depth_sigma_per_m > 0.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = 1", 'missing "frequencies"'),
        ("frequencies = {}", "frequencies = {}: Dictionary should have at least 1 item"),
        ("frequencies = {Mug = -1}", "frequencies.Mug = -1: Input should be greater than or equal to 0"),
        ('frequencies = {Mug = 1}\ngroups = {a = "Mug"}', "groups.a = 'Mug': Input should be a valid list"),
        ("frequencies = {Mug = 1}\npairs = {Mug = 3}", "pairs.Mug = 3: Input should be a valid dictionary"),
        ("frequencies = [", "not TOML"),
    ],
)
def test_bad_confusion_files_are_named(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "own.toml"
    path.write_text(text)
    with pytest.raises(InvalidArgumentError) as error:
        read_confusion(str(path))
    assert str(error.value).startswith(f"{path}: ")
    assert said in str(error.value)


def test_ones_own_confusion_is_used(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(
        'frequencies = {Mug = 1, Cup = 3, Bed = 0}\ngroups.a = ["Mug", "Cup", "Bed"]\npairs.Mug = {Cup = 3}\n'
    )
    confusion = read_confusion(str(path))
    shares = np.linspace(0.0, 0.999, 1000)
    assert np.mean([confusion.another("Mug", True, s) == "Cup" for s in shares]) == pytest.approx(0.75, abs=0.002)
    assert {confusion.another("Mug", False, s) for s in shares} == {"Cup"}
    assert np.mean([confusion.frequent(s) == "Cup" for s in shares]) == pytest.approx(0.75, abs=0.002)
    # Something that nobody has heard of is taken for what is frequent.
    assert confusion.another("Spaceship", True, 0.9) == "Cup"


def cosines() -> dict[str, np.ndarray]:
    """Of many pairs of features."""
    confusion = read_confusion()
    draws = np.random.default_rng(1)
    labels = confusion.categories
    things = {label: draws.standard_normal((4, DIMENSIONS - 2)) for label in labels}

    def seen(label: str, thing: int) -> np.ndarray:
        return image_feature((label,), confusion, things[label][thing], draws.standard_normal(DIMENSIONS - 2), 1.0)

    found: dict[str, list[float]] = {name: [] for name in ("object", "category", "other", "text", "other text")}
    texts = {label: text_feature(f"Go to the {words(label)}.", confusion) for label in labels}
    for label in labels:
        for thing in range(4):
            for other in draws.choice(labels, 6):
                found["object"].append(seen(label, thing) @ seen(label, thing))
                found["category"].append(seen(label, thing) @ seen(label, (thing + 1) % 4))
                found["text"].append(seen(label, thing) @ texts[label])
                if other != label:
                    found["other"].append(seen(label, thing) @ seen(other, 0))
                    found["other text"].append(seen(label, thing) @ texts[other])
    return {name: np.array(values) for name, values in found.items()}


def words(label: str) -> str:
    from evonav.tasks.language import noun_of

    return noun_of(label)


TARGETS = {
    "object": (0.85, 0.03),
    "category": (0.75, 0.05),
    "other": (0.55, 0.06),
    "text": (0.27, 0.03),
    "other text": (0.19, 0.03),
}
"""Mean and deviation: docs/perception.md says where from."""


def test_cosines_are_distributed_as_clips() -> None:
    for name, values in cosines().items():
        mean, deviation = TARGETS[name]
        assert values.mean() == pytest.approx(mean, abs=0.02), name
        assert values.std() == pytest.approx(deviation, abs=0.02), name


def test_names_are_told_from_features_about_as_well_as_by_clip() -> None:
    confusion, draws = read_confusion(), np.random.default_rng(0)
    labels = confusion.categories
    texts = np.array([text_feature(f"a photo of a {words(label)}.", confusion) for label in labels])
    ranks = []
    for number, label in enumerate(labels):
        for thing in draws.standard_normal((10, DIMENSIONS - 2)):
            views = [image_feature((label,), confusion, thing, view, 1.0) for view in draws.standard_normal((6, 62))]
            scores = texts @ np.mean(views, axis=0)
            ranks.append(int((scores > scores[number]).sum()))
    # ViT-B/32 names 63% of ImageNet's images rightly.
    assert np.mean(np.array(ranks) < 1) == pytest.approx(0.62, abs=0.04)
    assert np.mean(np.array(ranks) < 5) == pytest.approx(0.90, abs=0.03)


def test_features_are_unit_and_the_same_for_all_runs() -> None:
    confusion = read_confusion()
    text = text_feature("Please navigate to the mug on the dining table.", confusion)
    assert text.dtype == np.float32
    assert np.linalg.norm(text) == pytest.approx(1.0, abs=1e-6)
    assert (text == text_feature("Please navigate to the mug on the dining table.", confusion)).all()
    nothing = text_feature("Go somewhere nice.", confusion)
    assert np.linalg.norm(nothing) == pytest.approx(1.0, abs=1e-6)
    ones = _core.draw_normals(3, [["a"], ["b"], ["a"]], num_draws=4)
    assert (ones[0] == ones[2]).all()
    assert (ones[0] != ones[1]).all()


def test_the_first_noun_of_an_instruction_is_the_target() -> None:
    categories = read_confusion().categories
    assert nouns_of("two mugs near the TV stand, the Dining Table and a mug", categories) == [
        "Mug",
        "TVStand",
        "DiningTable",
    ]
    num = right = 0
    for path in sorted(BUNDLED_TASKS.glob("*/task.json")):
        for stage in load_spec(path.parent).stages:
            num += 1
            right += nouns_of(stage.public.unified_instruction, categories)[:1] == [stage.public.category]
    assert right == num > 50
