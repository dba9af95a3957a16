"""Draws docs/images/random-looks.jpg: one view in the house's own look, and in five random ones.

Run it without arguments; house and seeds are fixed.
"""

import sys
from pathlib import Path

from picture_sheets import grid
from PIL import Image

import evonav
from evonav.world.simulator import SimulatorConfig

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "random-looks.jpg"
HOUSE, SIDE_PX = 80, 240


def main() -> None:
    """See the module."""
    config = SimulatorConfig(width_px=SIDE_PX, height_px=SIDE_PX)
    simulator = evonav.Simulator(evonav.load_houses()[HOUSE], config=config)
    pictures = []
    for seed in range(6):
        if seed:
            simulator.randomize(seed=seed)
        pictures.append(Image.fromarray(simulator.look().rgb))
    grid(pictures, 3).save(PICTURE, quality=88)
    sys.stdout.write(f"{PICTURE}\n")


if __name__ == "__main__":
    main()
