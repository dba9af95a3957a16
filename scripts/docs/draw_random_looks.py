"""Draws docs/images/random-looks.jpg: one view in the house's own look, and in five random ones.

Run it without arguments; house and seeds are fixed.
"""

import sys
from pathlib import Path

from PIL import Image

import evonav
from evonav.world.simulator import SimulatorConfig

PICTURE = Path(__file__).parents[2] / "docs" / "images" / "random-looks.jpg"
HOUSE, SIDE_PX, NUM_COLS, GAP_PX = 80, 240, 3, 6


def main() -> None:
    """See the module."""
    config = SimulatorConfig(width_px=SIDE_PX, height_px=SIDE_PX)
    simulator = evonav.Simulator(evonav.load_houses()[HOUSE], config=config)
    step_px = SIDE_PX + GAP_PX
    sheet = Image.new("RGB", (NUM_COLS * step_px + GAP_PX, 2 * step_px + GAP_PX), "white")
    for seed in range(2 * NUM_COLS):
        if seed:
            simulator.randomize(seed=seed)
        row, col = divmod(seed, NUM_COLS)
        sheet.paste(Image.fromarray(simulator.look().rgb), (GAP_PX + col * step_px, GAP_PX + row * step_px))
    sheet.save(PICTURE, quality=88)
    sys.stdout.write(f"{PICTURE}\n")


if __name__ == "__main__":
    main()
