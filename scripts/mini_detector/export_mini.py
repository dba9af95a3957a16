"""Writes what `train_mini.py` learned as the file that evonav ships, and compares the two on real pictures.

    python scripts/mini_detector/export_mini.py mini.pt --tasks VAL_TASKS --out python/evonav/data/mini.weights

Batch normalisation goes into the convolutions, numbers become half-precision ones. Prints the largest difference
between torch's logits and the Rust core's, with the rounded weights and with the unrounded ones. Needs torch.
"""

import argparse
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import torch
from mini_frames import frames, house_files
from mini_net import MiniNet, inputs
from torch import nn
from train_mini import shrunk

from evonav import _core

DEPTHWISE = {"fuse0d"}


def main() -> None:
    """Exports and compares."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("--tasks", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    saved = torch.load(args.checkpoint)
    net = MiniNet(len(saved["classes"]))
    net.load_state_dict(saved["state"])
    net.eval()
    layers = {name: folded(layer) for name, layer in net.named_children()}
    args.out.write_bytes(packed(layers, saved["classes"]))
    num_parameters = sum(weights.size + bias.size for weights, bias in layers.values())
    print(f"step {saved['step']}: {num_parameters} parameters, {args.out.stat().st_size} bytes")
    core = _core.MiniNetwork(args.out.read_bytes())
    rounded = MiniNet(len(saved["classes"]))
    rounded.load_state_dict(saved["state"])
    rounded.eval()
    for name, layer in rounded.named_children():
        setattr(rounded, name, as_conv(layer, *layers[name]))
    worst = [0.0, 0.0]
    num = 0
    for frame in frames(house_files(args.tasks), 2, 5):
        num += 1
        mine = core.logits(frame.rgb, frame.depth_m, frame.horizon_rad)
        x = inputs(shrunk(frame.rgb)[None], shrunk(frame.depth_m)[None], np.array([frame.horizon_rad]))
        with torch.no_grad():
            for which, model in enumerate((rounded, net)):
                theirs = model(x)[0].permute(1, 2, 0).numpy()
                worst[which] = max(worst[which], float(np.abs(mine - theirs).max()))
    print(f"{num} pictures: largest difference of a logit {worst[0]:.2g}, to the unrounded weights {worst[1]:.2g}")


def folded(layer: nn.Module) -> tuple[np.ndarray, np.ndarray]:
    """Weights and biases with the normalisation in them, rounded to half precision."""
    if isinstance(layer, nn.Conv2d):
        weights, bias = layer.weight, layer.bias
    else:
        conv, norm = layer
        scale = norm.weight / torch.sqrt(norm.running_var + norm.eps)
        weights, bias = conv.weight * scale[:, None, None, None], norm.bias - norm.running_mean * scale
    return weights.detach().numpy().astype(np.float16), bias.detach().numpy().astype(np.float16)


def as_conv(layer: nn.Module, weights: np.ndarray, bias: np.ndarray) -> nn.Conv2d:
    """A plain convolution."""
    old = layer if isinstance(layer, nn.Conv2d) else layer[0]
    conv = nn.Conv2d(old.in_channels, old.out_channels, old.kernel_size, old.stride, old.padding, groups=old.groups)
    conv.weight.data = torch.from_numpy(weights.astype(np.float32))
    conv.bias.data = torch.from_numpy(bias.astype(np.float32))
    return conv


def packed(layers: dict[str, tuple[np.ndarray, np.ndarray]], classes: list[str]) -> bytes:
    """The file: see `evonav_core::perception::mini::weights`."""
    header: dict[str, Any] = {"format": "evonav-mini/2", "classes": classes, "layers": []}
    stem_or_down = {"stem", "down1", "down2", "down3"}
    for name, (weights, _) in layers.items():
        is_depthwise = name in DEPTHWISE
        header["layers"].append(
            {
                "name": name,
                "num_in": weights.shape[0] if is_depthwise else weights.shape[1],
                "num_out": weights.shape[0],
                "size": weights.shape[2],
                "stride": 2 if name in stem_or_down else 1,
                "is_depthwise": is_depthwise,
            }
        )
    text = json.dumps(header, separators=(",", ":")).encode()
    numbers = b"".join(weights.tobytes() + bias.tobytes() for weights, bias in layers.values())
    return b"EVONAVNN" + struct.pack("<I", len(text)) + text + numbers


if __name__ == "__main__":
    main()
