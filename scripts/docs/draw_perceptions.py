"""Draws one view as each preset of simulated perception tells of it: `docs/images/perception-presets.png`.

python scripts/docs/draw_perceptions.py [OUT.png] [--task N] [--place N] [--yaw DEG]
"""

import argparse
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from evonav.evaluation.run.components import load_spec
from evonav.perception import StageScene
from evonav.perception.ground_truth import GroundTruthPerception
from evonav.perception.noise import noise_presets
from evonav.perception.simulated import noisy_perception
from evonav.sensors.observation import Detections
from evonav.tasks.language import noun_of
from evonav.tasks.listing import BUNDLED_TASKS
from evonav.world.embedded import EmbeddedSimulator
from evonav.world.simulator import Frame

RIGHT, WRONG, MISSED = (60, 170, 90), (225, 70, 50), (120, 120, 130)
SCALE, TITLE_PX = 2, 30
ROWS = (30, 250)
"""Of the view, that are drawn."""
COLOURS = 96


def main() -> None:
    """Renders, perceives, draws."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", nargs="?", type=Path, default=Path("docs/images/perception-presets.png"))
    parser.add_argument("--task", type=int, default=3)
    parser.add_argument("--place", type=int, default=714)
    parser.add_argument("--yaw", type=float, default=90.0)
    given = parser.parse_args()
    scene, frame = view(given.task, given.place, math.radians(given.yaw))
    exact = GroundTruthPerception()
    exact.begin_stage(scene)
    truth = exact.perceive([frame])[0].detections
    panels = []
    for preset in noise_presets():
        perception = noisy_perception(preset)
        perception.begin_stage(scene)
        panels.append(panel(preset, frame, truth, perception.perceive([frame])[0].detections))
    width, height = panels[0].size
    sheet = Image.new("RGB", (2 * width + 8, 2 * height + 8), "white")
    for place, one in enumerate(panels):
        sheet.paste(one, ((place % 2) * (width + 8), (place // 2) * (height + 8)))
    sheet.quantize(COLOURS, dither=Image.Dither.NONE).save(given.out, optimize=True)
    print(f"{given.out}: {given.out.stat().st_size} bytes")


def view(task: int, place: int, yaw_rad: float) -> tuple[StageScene, Frame]:
    """A view in a bundled house."""
    simulator = EmbeddedSimulator()
    case = load_spec(sorted(BUNDLED_TASKS.glob("*/task.json"))[task].parent)
    simulator.reset(case.stages[0].house_json)
    places = simulator.reachable_positions()
    x_m, _, z_m = places[place % len(places)].tolist()
    pose = replace(simulator.pose, x_m=x_m, z_m=z_m, yaw_rad=yaw_rad)
    scene = StageScene(case.task_id, case.stages[0].public, "fu", 0, tuple(simulator.objects))
    return scene, simulator.render(pose, rgb=True, instances=True)


def panel(preset: str, frame: Frame, truth: Detections, told: Detections) -> Image.Image:
    """The view, greyed, with masks in colour: right, wrong or nothing there; what was missed is outlined."""
    assert frame.rgb is not None
    grey = frame.rgb.mean(axis=2, keepdims=True).repeat(3, axis=2) * 0.6 + 90.0
    names = []
    is_found = np.zeros(len(truth.labels), bool)
    for number, label in enumerate(told.labels):
        mask = told.masks == number
        own = truth.masks[mask]
        hits = np.bincount(own[own >= 0], minlength=len(truth.labels))
        best = int(hits.argmax()) if hits.size else 0
        is_there = hits.size > 0 and 2 * int(hits[best]) > int(mask.sum())
        is_right = is_there and truth.labels[best] == label
        if is_there:
            is_found[best] = True
        grey[mask] = 0.4 * grey[mask] + 0.6 * np.array(RIGHT if is_right else WRONG)
        names.append((mask, noun_of(label), float(told.confidences[number]), is_right))
    for number in np.flatnonzero(~is_found).tolist():
        grey[outline(truth.masks == number)] = MISSED
    top, bottom = ROWS
    image = Image.fromarray(grey[top:bottom].clip(0, 255).astype(np.uint8))
    image = image.resize((SCALE * image.width, SCALE * image.height), Image.Resampling.BILINEAR)
    sheet = Image.new("RGB", (image.width, image.height + TITLE_PX), "white")
    sheet.paste(image, (0, TITLE_PX))
    draw = ImageDraw.Draw(sheet)
    missed = f", {int((~is_found).sum())} missed" if (~is_found).any() else ""
    wrong = sum(not is_right for *_, is_right in names)
    title = f"{preset}: {len(names) - wrong} right" + (f", {wrong} wrong" if wrong else "") + missed
    draw.text((4, 4), title, fill="black", font=ImageFont.load_default(18))
    font = ImageFont.load_default(12)
    for mask, noun, confidence, is_right in names:
        rows, cols = np.nonzero(mask)
        text = noun if confidence == 1.0 else f"{noun} {confidence:.2f}"
        at = (SCALE * float(np.median(cols)), SCALE * float(np.median(rows) - top) + TITLE_PX)
        box = draw.textbbox(at, text, font=font, anchor="mm")
        shift = max(0.0, 2 - box[0]) - max(0.0, box[2] + 2 - sheet.width)
        at = (at[0] + shift, at[1])
        box = draw.textbbox(at, text, font=font, anchor="mm")
        draw.rectangle((box[0] - 2, box[1] - 1, box[2] + 2, box[3] + 1), fill="white" if is_right else (255, 225, 220))
        draw.text(at, text, fill="black" if is_right else (150, 20, 10), font=font, anchor="mm")
    return sheet


def outline(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels of a mask beside others."""
    inside = mask.copy()
    inside[1:] &= mask[:-1]
    inside[:-1] &= mask[1:]
    inside[:, 1:] &= mask[:, :-1]
    inside[:, :-1] &= mask[:, 1:]
    found: NDArray[np.bool_] = mask & ~inside
    return found


if __name__ == "__main__":
    main()
