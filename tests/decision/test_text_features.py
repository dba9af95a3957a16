"""MiniLM's features against those that onnxruntime 1.31 and transformers made of the same files; ranking by them."""

from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import SimpleNamespace

import numpy as np
import pytest
from bundled_run import bundled_run

from evonav.agents.frontier_update.agent import FrontierUpdate, FrontierUpdateConfig
from evonav.decision.candidates import ObjectCandidate
from evonav.decision.text import minilm
from evonav.decision.text.ranking import rank_by_text, similarity_of_label, text_feature
from evonav.errors import InvalidArgumentError

needs_weights = pytest.mark.skipif(
    any(find_spec(name) is None for name in minilm.MODULES), reason="needs the extra evonav[text]"
)

# Every 64th number, by onnxruntime 1.31.1 from the same file.
GOLDEN = {
    "refrigerator": (
        [101, 18097, 102],
        [-0.11168, 0.02161, 0.01219, 0.05735, 0.03846, -0.02008],
    ),
    "Please navigate to the tall, slim grey floor lamp next to the sofa.": (
        [101, 3531, 22149, 2000, 1996, 4206, 1010, 11754, 4462, 2723, 10437, 2279, 2000, 1996, 10682, 1012, 102],
        [0.09409, -0.03647, 0.05011, 0.00542, -0.10145, -0.038],
    ),
    "Naïve café: 椅子 unbelievablyxyzzyq!": (
        [101, 15743, 7668, 1024, 100, 1816, 4895, 8671, 2666, 3567, 6321, 18037, 28753, 4160, 999, 102],
        [-0.04139, 0.01825, -0.05597, -0.03851, -0.02761, -0.04966],
    ),
}
PROBES = {
    "couch": "Sofa",
    "refrigerator": "Fridge",
    "bookcase": "ShelvingUnit",
    "trash can": "GarbageCan",
    "smartphone": "CellPhone",
    "skillet": "Pan",
    "lavatory": "Toilet",
    "TV screen": "Television",
}
LABELS = ("Bed", "Chair", "Mug", "HousePlant", "Knife", "Painting", *PROBES.values())


@needs_weights
@pytest.mark.parametrize("text", GOLDEN)
def test_sentences_are_those_of_the_published_model(text: str) -> None:
    tokens, numbers = GOLDEN[text]
    assert minilm.encoder().tokens(text) == tokens
    feature = text_feature(text)
    assert feature.shape == (384,)
    np.testing.assert_allclose(feature[::64], numbers, atol=1e-4)
    assert np.linalg.norm(feature) == pytest.approx(1.0, abs=1e-5)


@needs_weights
def test_endless_texts_and_words_are_cut() -> None:
    assert len(minilm.encoder().tokens("chair " * 1000)) == 256
    assert minilm.encoder().tokens("x" * 101) == [101, 100, 102]
    assert np.isfinite(text_feature("")).all()


@needs_weights
def test_synonyms_are_near_what_they_mean() -> None:
    nearest = {
        said: max(LABELS, key=lambda label: similarity_of_label(f"Please navigate to the {said}.", label))
        for said in PROBES
    }
    assert nearest == PROBES


@needs_weights
def test_entries_are_ranked_by_meaning_then_as_ever() -> None:
    def entry(entry_id: int, label: str, x_m: float, num_detections: int = 1) -> ObjectCandidate:
        return ObjectCandidate(
            entry_id=entry_id,
            label=label,
            centre_m=(x_m, 0.5, 0.0),
            size_m=(0.5, 0.5, 0.5),
            num_detections=num_detections,
        )

    goal = SimpleNamespace(unified_instruction="Please navigate to the loveseat.")
    entries = [entry(0, "Mug", 1.0), entry(1, "Sofa", 3.0), entry(2, "Sofa", 2.0), entry(3, "Sofa", 9.0, 2)]
    assert rank_by_text(goal, entries, (0.0, 0.0)) == [3, 2, 1, 0]


@needs_weights
def test_agents_walk_by_it(tmp_path) -> None:
    agents = [f"agents_by_meaning:{name}" for name in ("fu", "ftu", "stage_reset")]
    records = bundled_run(tmp_path, agents, max_rounds=4)
    assert len(records) >= 9
    assert all(record.is_scored for record in records)


@pytest.mark.parametrize("missing", minilm.MODULES)
def test_a_missing_package_of_the_extra_is_named(monkeypatch, missing) -> None:
    minilm.encoder.cache_clear()
    monkeypatch.setattr(minilm, "find_spec", lambda name: None if name == missing else ModuleSpec(name, None))
    package = missing.replace("_", "-")
    with pytest.raises(InvalidArgumentError, match=rf"{package}: run `pip install 'evonav\[text\]'"):
        FrontierUpdate(FrontierUpdateConfig(ranking="text"))


@needs_weights
def test_other_weights_are_refused(monkeypatch, tmp_path) -> None:
    (tmp_path / "model.onnx").write_bytes(b"something else")
    minilm.encoder.cache_clear()
    monkeypatch.setattr(minilm, "files", lambda package: tmp_path)
    with pytest.raises(InvalidArgumentError, match="has the checksum"):
        minilm.encoder()


@needs_weights
def test_weights_that_are_gone_are_named(monkeypatch, tmp_path) -> None:
    minilm.encoder.cache_clear()
    monkeypatch.setattr(minilm, "files", lambda package: tmp_path)
    with pytest.raises(InvalidArgumentError, match=r"model\.onnx cannot be read"):
        minilm.encoder()
