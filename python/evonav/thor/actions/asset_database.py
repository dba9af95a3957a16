"""List the assets that can be spawned: evonav's asset catalogue."""

from functools import cache
from typing import Any

from evonav import _core
from evonav.thor.actions.registry import action
from evonav.thor.asset_metadata import metadata_of_asset
from evonav.thor.engine import Engine


def is_known(asset_id: str) -> bool:
    """Return whether the catalogue contains the asset, and with it the asset's size."""
    return asset_id in _sizes()


@action("GetAssetDatabase")
def get_asset_database(engine: Engine) -> dict[str, dict[str, Any]]:
    """Return the metadata of all assets by id, with the keys of the `procthor` package's asset database."""
    return _database()


@cache
def _sizes() -> dict[str, tuple[str, tuple[float, float, float]]]:
    """Return category and size in metres, by asset id."""
    return {asset_id: (category, size_m) for asset_id, category, size_m in _core.assets()}


@cache
def _database() -> dict[str, dict[str, Any]]:
    return {asset_id: _entry(asset_id, category, size_m) for asset_id, (category, size_m) in _sizes().items()}


def _entry(asset_id: str, category: str, size_m: tuple[float, float, float]) -> dict[str, Any]:
    flags = metadata_of_asset(asset_id, category).flags
    primary = next((name for flag, name in _PRIMARY if flag in flags), "Static")
    return {
        "assetId": asset_id,
        "objectType": category,
        "primaryProperty": primary,
        "secondaryProperties": [name for flag, name in _SECONDARY if flag in flags],
        "boundingBox": dict(zip("xyz", size_m, strict=True)),
    }


_PRIMARY = (("pickupable", "CanPickup"), ("moveable", "Moveable"))
_SECONDARY = (
    ("receptacle", "Receptacle"),
    ("openable", "CanOpen"),
    ("toggleable", "CanToggleOnOff"),
    ("breakable", "CanBreak"),
    ("canFillWithLiquid", "CanBeFilled"),
    ("dirtyable", "CanBeDirty"),
    ("canBeUsedUp", "CanBeUsedUp"),
    ("cookable", "CanBeCooked"),
    ("isHeatSource", "isHeatSource"),
    ("isColdSource", "isColdSource"),
    ("sliceable", "CanBeSliced"),
)
