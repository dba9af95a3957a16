"""A folder of models as a user has one, with tiny networks of random weights in place of the published ones."""

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from evonav.perception.vocabulary import DINO_UNIGOAL

SIDE_PX = 64


def _write_clip_tokenizer(folder: Path) -> None:
    """The vocabulary that open_clip comes with, as transformers reads it."""
    import open_clip
    from transformers import CLIPTokenizer

    merges_file = Path(open_clip.__file__).with_name("bpe_simple_vocab_16e6.txt.gz")
    lines = gzip.decompress(merges_file.read_bytes()).decode().split("\n")[1 : 49152 - 256 - 2 + 1]
    tokenizer = open_clip.tokenizer.SimpleTokenizer()
    vocabulary = {
        token.replace("<start_of_text>", "<|startoftext|>").replace("<end_of_text>", "<|endoftext|>"): index
        for token, index in tokenizer.encoder.items()
    }
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "vocab.json").write_text(json.dumps(vocabulary), encoding="utf-8")
    (folder / "merges.txt").write_text("#version: 0.2\n" + "\n".join(lines) + "\n", encoding="utf-8")
    CLIPTokenizer(str(folder / "vocab.json"), str(folder / "merges.txt"), model_max_length=77).save_pretrained(folder)
    # Published repositories have these beside what this version of the library writes.
    for name in ("vocab.json", "merges.txt"):
        assert (folder / name).is_file()


def _text_config() -> dict:
    return {
        "vocab_size": 49408,
        "hidden_size": 32,
        "intermediate_size": 37,
        "num_hidden_layers": 2,
        "num_attention_heads": 4,
        "bos_token_id": 49406,
        "eos_token_id": 49407,
        "pad_token_id": 0,
    }


def _write_clip(folder: Path) -> None:
    from transformers import CLIPConfig, CLIPImageProcessor, CLIPModel

    vision = {"hidden_size": 32, "intermediate_size": 37, "num_hidden_layers": 2, "num_attention_heads": 4}
    config = CLIPConfig(
        text_config=_text_config(),
        vision_config={**vision, "image_size": 32, "patch_size": 8},
        projection_dim=24,
    )
    CLIPModel(config).save_pretrained(folder)
    CLIPImageProcessor(size={"shortest_edge": 32}, crop_size={"height": 32, "width": 32}).save_pretrained(folder)
    _write_clip_tokenizer(folder)


def _write_owlv2(folder: Path) -> None:
    from transformers import Owlv2Config, Owlv2ForObjectDetection, Owlv2ImageProcessor

    vision = {"hidden_size": 32, "intermediate_size": 37, "num_hidden_layers": 2, "num_attention_heads": 4}
    config = Owlv2Config(
        text_config={**_text_config(), "max_position_embeddings": 16},
        vision_config={**vision, "image_size": SIDE_PX, "patch_size": 8},
        projection_dim=32,
    )
    Owlv2ForObjectDetection(config).save_pretrained(folder)
    Owlv2ImageProcessor(size={"height": SIDE_PX, "width": SIDE_PX}).save_pretrained(folder)
    _write_clip_tokenizer(folder)


def _write_sam(folder: Path) -> None:
    from transformers import SamConfig, SamImageProcessor, SamModel

    config = SamConfig(
        vision_config={
            "hidden_size": 32,
            "output_channels": 16,
            "num_hidden_layers": 2,
            "num_attention_heads": 4,
            "image_size": SIDE_PX,
            "patch_size": 8,
            "global_attn_indexes": [1],
            "num_pos_feats": 8,
            "mlp_dim": 64,
        },
        prompt_encoder_config={
            "hidden_size": 16,
            "image_size": SIDE_PX,
            "patch_size": 8,
            "mask_input_channels": 4,
            "image_embedding_size": SIDE_PX // 8,
        },
        mask_decoder_config={
            "hidden_size": 16,
            "mlp_dim": 32,
            "num_hidden_layers": 2,
            "num_attention_heads": 4,
            "iou_head_hidden_dim": 16,
        },
    )
    SamModel(config).save_pretrained(folder)
    SamImageProcessor(
        size={"longest_edge": SIDE_PX},
        pad_size={"height": SIDE_PX, "width": SIDE_PX},
        mask_size={"longest_edge": 16},
        mask_pad_size={"height": 16, "width": 16},
    ).save_pretrained(folder)


def _write_grounding_dino(folder: Path) -> None:
    from transformers import (
        BertTokenizer,
        GroundingDinoConfig,
        GroundingDinoForObjectDetection,
        GroundingDinoImageProcessor,
        GroundingDinoProcessor,
        SwinConfig,
    )

    folder.mkdir(parents=True)
    tokens = ["[PAD]", "[UNK]", "[CLS]", "[SEP]", "[MASK]", ".", "?"]
    tokens += sorted({part for word in DINO_UNIGOAL for part in word.split()})
    (folder / "vocab.txt").write_text("\n".join(tokens) + "\n", encoding="utf-8")
    config = GroundingDinoConfig(
        backbone_config=SwinConfig(
            embed_dim=16, depths=[1, 1, 1, 1], num_heads=[2, 2, 2, 2], window_size=4, out_indices=[2, 3, 4]
        ),
        text_config={
            "model_type": "bert",
            "vocab_size": len(tokens),
            "hidden_size": 32,
            "num_hidden_layers": 2,
            "num_attention_heads": 4,
            "intermediate_size": 37,
        },
        d_model=32,
        num_queries=20,
        encoder_layers=1,
        decoder_layers=2,
        encoder_ffn_dim=32,
        decoder_ffn_dim=32,
        encoder_attention_heads=4,
        decoder_attention_heads=4,
        num_feature_levels=4,
        max_text_len=256,
    )
    GroundingDinoForObjectDetection(config).save_pretrained(folder)
    size = {"shortest_edge": 2 * SIDE_PX, "longest_edge": 2 * SIDE_PX}
    GroundingDinoProcessor(
        GroundingDinoImageProcessor(size=size), BertTokenizer(str(folder / "vocab.txt"))
    ).save_pretrained(folder)
    GroundingDinoImageProcessor(size=size).save_pretrained(folder)


@pytest.fixture(scope="session")
def tiny_models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for `--models`, of transformers."""
    import torch

    torch.set_num_threads(1)  # tiny networks gain nothing from more, and lose much where other processes compute too
    torch.manual_seed(0)
    folder = tmp_path_factory.mktemp("models")
    _write_clip(folder / "laion/CLIP-ViT-B-32-laion2B-s34B-b79K")
    _write_owlv2(folder / "google/owlv2-base-patch16-ensemble")
    _write_sam(folder / "facebook/sam-vit-large")
    _write_sam(folder / "facebook/sam-vit-huge")
    _write_grounding_dino(folder / "IDEA-Research/grounding-dino-tiny")
    return folder


@pytest.fixture
def images() -> list[np.ndarray]:
    """Three that differ."""
    return [np.random.default_rng(seed).integers(0, 256, (96, 96, 3), dtype=np.uint8) for seed in range(3)]
