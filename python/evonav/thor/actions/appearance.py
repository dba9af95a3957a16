"""Domain randomisation: random materials, colours and light.

AI2-THOR draws again in every session. Here the draws depend on the scene's name, on `SetRandomSeed`, and on the number
of such actions before, so that a session that is run again looks the same. A `seed` of the action itself overrides
that.
"""

import hashlib
from collections.abc import Sequence
from typing import Any

from evonav.thor.actions.registry import ActionError, action
from evonav.thor.engine import Engine
from evonav.world.appearance import Colors, Lighting, Materials, Range, Split

_ROOM_TYPES = {"bedroom": "Bedroom", "bathroom": "Bathroom", "livingroom": "LivingRoom", "kitchen": "Kitchen"}
_VALID_ROOM_TYPES = '{"Bedroom", "Bathroom", "LivingRoom", "Kitchen", "RoboTHOR"}'
_ROBOTHOR = "robothor"
"""A type that AI2-THOR accepts and no house has."""


@action("RandomizeMaterials", unused={"useExternalMaterials": bool})
def randomize_materials(
    engine: Engine,
    *,
    useTrainMaterials: bool | None = None,
    useValMaterials: bool | None = None,
    useTestMaterials: bool | None = None,
    inRoomTypes: list[str] | None = None,
    objectTypes: list[str] | None = None,
    seed: int | None = None,
) -> dict[str, Any]:
    """Give everything in rooms of some types, and of some object types, other materials of its class."""
    chosen = _room_types(inRoomTypes)
    uses = {"Train": useTrainMaterials, "Val": useValMaterials, "Test": useTestMaterials}
    is_used = {name: value is not False for name, value in uses.items()}
    splits: list[Split] = [split for split in ("train", "val", "test") if is_used[split.capitalize()]]
    seed = _seed(engine, "RandomizeMaterials", seed)
    num_materials = 0
    if splits and chosen != []:
        engine.scene.randomize(
            Materials(seed, categories=objectTypes, room_types=chosen, splits=None if len(splits) == 3 else splits)
        )
        num_materials = engine.scene.simulator.core.num_materials()
    return {
        "chosenRoomTypes": sorted(inRoomTypes or [*_ROOM_TYPES.values(), "RoboTHOR"]),
        **{f"use{name}Materials": value for name, value in is_used.items()},
        "totalMaterialsConsidered": num_materials,
        "seed": seed,
    }


@action("RandomizeColors", "ChangeColorOfMaterials")
def randomize_colors(engine: Engine, *, seed: int | None = None) -> None:
    """Give all materials any colours."""
    engine.scene.randomize(Colors(_seed(engine, "RandomizeColors", seed)))


@action("RandomizeLighting")
def randomize_lighting(
    engine: Engine,
    *,
    synchronized: bool = False,
    brightness: list[float] | None = None,
    randomizeColor: bool = True,
    hue: list[float] | None = None,
    saturation: list[float] | None = None,
    seed: int | None = None,
) -> None:
    """Give the light in each room, and the sun, another brightness and colour."""
    for name, value in (("hue", hue), ("saturation", saturation)):
        if value is not None and not randomizeColor:
            raise ActionError(f"Cannot pass in randomizeColor=False while also providing {name}={value}.")
    brightness, hue, saturation = brightness or [0.5, 1.5], hue or [0.0, 1.0], saturation or [0.5, 1.0]
    if any(len(values) != 2 for values in (brightness, hue, saturation)):
        raise ActionError(
            "Ranges for hue, saturation, and brightness must each have 2 values."
            f" You gave saturation={saturation}, hue={hue}, brightness={brightness}."
        )
    if min(brightness) < 0:
        raise ActionError(f"Each brightness must be >= 0, not brightness={brightness}.")
    for name, values in (("hue", hue), ("saturation", saturation)):
        if min(values) < 0 or max(values) > 1:
            raise ActionError(f"{name} range must be in [0:1], not {values}")
    engine.scene.randomize(
        Lighting(
            _seed(engine, "RandomizeLighting", seed),
            brightness=_range(brightness),
            randomize_color=randomizeColor,
            hue=_range(hue),
            saturation=_range(saturation),
            synchronized=synchronized,
        )
    )


@action("ResetMaterials")
def reset_materials(engine: Engine) -> None:
    """Give everything its own materials and colours again."""
    engine.scene.restore(Materials, Colors)


@action("ResetColors")
def reset_colors(engine: Engine) -> None:
    """Give all materials the colours that they had before `RandomizeColors`."""
    engine.scene.restore(Colors)


@action("ResetLighting")
def reset_lighting(engine: Engine) -> None:
    """Give the house its own light again."""
    engine.scene.restore(Lighting)


def _room_types(names: Sequence[str] | None) -> list[str] | None:
    """Return the types of a house's rooms with these names; casing is ignored, as in AI2-THOR."""
    if names is None:
        return None
    if not names:
        raise ActionError("inRoomTypes must have a non-zero length!")
    for name in names:
        if name.lower() not in (*_ROOM_TYPES, _ROBOTHOR):
            raise ActionError(
                f"inRoomTypes contains unknown room type: {name}.\nValid room types include {_VALID_ROOM_TYPES}"
            )
    return [_ROOM_TYPES[name.lower()] for name in names if name.lower() != _ROBOTHOR]


def _seed(engine: Engine, name: str, seed: int | None) -> int:
    """Return the seed of an action: the given one, or the next of the session."""
    if seed is not None:
        return seed
    engine.num_randomizations += 1
    text = f"{engine.scene.name}|{engine.random_seed}|{name}|{engine.num_randomizations}"
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "big")


def _range(values: Sequence[float]) -> Range:
    return (values[0], values[1])
