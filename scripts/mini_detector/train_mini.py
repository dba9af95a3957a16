"""Trains the mini detector on pictures of the embedded simulator: `python scripts/mini_detector/train_mini.py --help`.

    python scripts/mini_detector/train_mini.py --tasks TRAIN_TASKS --out mini.pt --steps 3000

`--tasks` are folders of tasks made from houses of the *train* split with `evonav tasks generate` (ours: 1,000 houses
of `attr-onav-1k-train-1000.jsonl.gz`, the bundled houses of the train split and 17 of `tiny-train.jsonl.gz`, see
CONTRIBUTING.md on data sets; houses of ProcTHOR-10k do as well). Needs torch. Prints the loss every 50 steps and
saves every 250; the same arguments, machine and torch give the same weights. `--on-from CHECKPOINT` goes on with the
weights and types of an earlier training. `export_mini.py` makes what ships.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from mini_frames import frames, house_files
from mini_net import SIDE_PX, MiniNet, inputs
from numpy.typing import NDArray
from torch.nn import functional

BATCH = 16
PER_HOUSE = 9
TILTED = 0.5
"""Most houses of the train splits have cameras that look down 30 degrees, others look straight ahead."""
BACKGROUND_KEPT = 0.2
"""Share of the background's cells that a step learns from."""
BACKGROUND_WEIGHT = 2.0
LINK_WEIGHT = 1.0


@dataclass
class Pictures:
    """Frames of one pass, in the resolution that the network sees."""

    rgb: NDArray[np.uint8]
    depth_m: NDArray[np.float16]
    instances: NDArray[np.uint8]
    classes: NDArray[np.uint8]
    """`(N, 256)`: of each frame's instances; 0 is the background."""
    horizons_rad: NDArray[np.float64]


def main() -> None:
    """Trains, from the start or on from a checkpoint."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tasks", nargs="+", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--on-from", type=Path)
    parser.add_argument("--steps", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--lr", type=float, default=4e-3)
    args = parser.parse_args()
    torch.manual_seed(args.seed)
    torch.set_num_threads(1)
    tasks = [task for folder in args.tasks for task in house_files(folder)]
    saved = torch.load(args.on_from) if args.on_from else None
    pictures, classes = render(tasks, args.seed, saved["classes"] if saved else None)
    print(f"{len(tasks)} houses, {len(classes)} types", flush=True)
    net = MiniNet(len(classes))
    if saved:
        net.load_state_dict(saved["state"])
    optimizer = torch.optim.AdamW(net.parameters(), lr=args.lr, weight_decay=1e-2)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, args.lr, total_steps=args.steps, pct_start=0.1)
    batches = endless(tasks, pictures, classes, args.seed)
    began_s, losses = time.perf_counter(), []
    for step in range(args.steps):
        pair = loss_of(net, next(batches))
        optimizer.zero_grad()
        sum(pair).backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 5.0)
        optimizer.step()
        schedule.step()
        losses.append([part.item() for part in pair])
        if step % 50 == 49:
            label, link = np.mean(losses[-50:], 0)
            spent_s = time.perf_counter() - began_s
            print(f"step {step + 1}: labels {label:.3f} links {link:.3f} after {spent_s:.0f} s", flush=True)
        if step % 250 == 249 or step + 1 == args.steps:
            torch.save({"classes": classes, "state": net.state_dict(), "step": step + 1}, args.out)


def render(tasks: list[list[Path]], seed: int, classes: list[str] | None) -> tuple[Pictures, list[str]]:
    """One pass of frames; the classes are those of the first pass."""
    num = len(tasks) * PER_HOUSE
    shape = (num, SIDE_PX, SIDE_PX)
    found = Pictures(
        rgb=np.empty((*shape, 3), np.uint8),
        depth_m=np.empty(shape, np.float16),
        instances=np.empty(shape, np.uint8),
        classes=np.zeros((num, 256), np.uint8),
        horizons_rad=np.empty(num),
    )
    labels = []
    for index, frame in enumerate(frames(tasks, PER_HOUSE, seed, TILTED)):
        found.rgb[index] = shrunk(frame.rgb)
        found.depth_m[index] = np.minimum(shrunk(frame.depth_m), 20.0)
        found.instances[index] = shrunk(frame.instances)
        found.horizons_rad[index] = frame.horizon_rad
        labels.append(frame.labels)
    if classes is None:
        classes = sorted({label for names in labels for label in names})
    number = {label: 1 + index for index, label in enumerate(classes)}
    for row, names in zip(found.classes, labels, strict=True):
        row[1 : 1 + len(names)] = [number.get(name, 0) for name in names]
    return found, classes


def shrunk(image: np.ndarray) -> np.ndarray:
    """The pixel in the middle of each cell of a square picture of `SIDE_PX`."""
    rows = (2 * np.arange(SIDE_PX) + 1) * image.shape[0] // (2 * SIDE_PX)
    cols = (2 * np.arange(SIDE_PX) + 1) * image.shape[1] // (2 * SIDE_PX)
    return image[rows[:, None], cols]


Batch = tuple[torch.Tensor, NDArray[np.int64], NDArray[np.int64]]


def endless(tasks: list[list[Path]], pictures: Pictures, classes: list[str], seed: int) -> Iterator[Batch]:
    """Inputs, instances and classes of the cells; every pass over the houses has frames of its own."""
    rng = np.random.default_rng(seed)
    for count in range(1_000_000):
        if count:
            pictures, _ = render(tasks, seed + count, classes)
        order = rng.permutation(len(pictures.rgb))
        for first in range(0, len(order) - BATCH + 1, BATCH):
            rows = np.sort(order[first : first + BATCH])
            rgb, depth_m, instances = pictures.rgb[rows], pictures.depth_m[rows], pictures.instances[rows]
            if rng.random() < 0.5:
                rgb, depth_m, instances = (np.ascontiguousarray(x[:, :, ::-1]) for x in (rgb, depth_m, instances))
            cells = instances[:, ::2, ::2].astype(np.int64)
            x = inputs(rgb, depth_m, pictures.horizons_rad[rows])
            yield x, cells, by_number(pictures.classes[rows].astype(np.int64), cells)


def by_number(values: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Of each frame's row of `values`, the one that each cell's number stands for."""
    return np.take_along_axis(values, numbers.reshape(len(numbers), -1), 1).reshape(numbers.shape)


def loss_of(net: MiniNet, batch: Batch) -> tuple[torch.Tensor, torch.Tensor]:
    """Of labels and of links, over all objects' cells and some of the background's."""
    x, cells, classes = batch
    kept = (cells > 0) | (torch.rand(cells.shape).numpy() < BACKGROUND_KEPT)
    sizes = np.stack([np.bincount(frame.ravel(), minlength=256) for frame in cells])
    area = by_number(sizes, cells)
    # An object's weight grows with the root of its area, not with the area.
    weight = np.where(cells > 0, np.clip(np.sqrt(100.0 / area), 0.4, 5.0), BACKGROUND_WEIGHT).astype(np.float32)
    features = net.features(x).permute(0, 2, 3, 1)[torch.from_numpy(kept)]
    logits = functional.linear(features, net.head.weight[:, :, 0, 0], net.head.bias)
    weights = torch.from_numpy(weight[kept])
    known = torch.from_numpy(classes[kept])
    labels = functional.cross_entropy(logits[:, : net.num_classes + 1], known, reduction="none")
    right, below = np.zeros_like(cells, bool), np.zeros_like(cells, bool)
    right[:, :, :-1], below[:, :-1] = cells[:, :, :-1] == cells[:, :, 1:], cells[:, :-1] == cells[:, 1:]
    same = torch.from_numpy(np.stack([right[kept], below[kept]], 1)).float()
    links = functional.binary_cross_entropy_with_logits(logits[:, -2:], same, reduction="none").sum(1)
    links = links * torch.from_numpy((cells > 0)[kept].astype(np.float32))  # only within objects do they matter
    total = weights.sum()
    return (labels * weights).sum() / total, LINK_WEIGHT * (links * weights).sum() / total


if __name__ == "__main__":
    main()
