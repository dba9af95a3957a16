"""Builds the asset catalogue that ships with evonav: `rust/evonav-core/data/*.json`.

    python scripts/build_asset_catalogue.py DATA [--out rust/evonav-core/data]

DATA is a directory with

* `procthor-databases/`: the databases of the package `procthor` 0.0.1.dev2 (Allen Institute for AI, Apache-2.0):
  boxes, splits, properties and materials of 1,653 assets, what AI2-THOR says they are made of, placement annotations,
  receptacles, asset groups;
* `molmospaces-resources/material_to_textures.json` (allenai/molmospaces, Apache-2.0): albedo tint and texture name of
  1,245 materials. The textures themselves are not published with it, see `texture_mean`;
* any house files (`.json`, `.jsonl`, `.gz` of each) in which the simulator placed children on receptacles: the heights
  at which they rest become the assets' surface heights. Houses under `procthor-generated/` are left out: their
  children were placed with such heights in the first place.

The output is deterministic: same input, same bytes.
"""

from __future__ import annotations

import argparse
import gzip
import json
import math
import re
import statistics
import zlib
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TypeAlias

Json: TypeAlias = dict[str, Any]
Rgb: TypeAlias = tuple[float, float, float]

CREDIT = (
    "Derived by scripts/build_asset_catalogue.py from the databases of the package procthor 0.0.1.dev2 and from "
    "allenai/molmospaces (both Allen Institute for AI, Apache-2.0)."
)
PROPERTIES = {"CanPickup": "pickupable", "Moveable": "moveable", "Receptacle": "receptacle", "CanOpen": "openable"}
ROOMS = {"Kitchen": "inKitchens", "LivingRoom": "inLivingRooms", "Bedroom": "inBedrooms", "Bathroom": "inBathrooms"}
WHERE = {"corner": "inCorner", "middle": "inMiddle", "edge": "onEdge", "floor": "onFloor", "wall": "onWall"}

# Mean colour of a texture, guessed from words in its file name or the material's name; first match counts.
TEXTURE_WORDS: tuple[tuple[str, Rgb], ...] = (
    ("tablecloth|towel|cloth", (0.72, 0.68, 0.62)),
    ("drywall|plaster|trim|mattress|sheet|pillow|wallpanel", (0.92, 0.91, 0.88)),
    ("blackmarble", (0.16, 0.16, 0.17)),
    ("marble|granite", (0.82, 0.79, 0.75)),
    ("white", (0.90, 0.89, 0.87)),
    ("dark.?wood|woodfine0038", (0.33, 0.22, 0.15)),
    ("light.?wood|woodfine.*pale|woodfine0044", (0.80, 0.67, 0.49)),
    ("medium.?wood", (0.60, 0.42, 0.27)),
    ("wood|oak|cabinet|hatch", (0.58, 0.42, 0.28)),
    ("brick", (0.58, 0.33, 0.26)),
    ("concrete", (0.62, 0.61, 0.59)),
    ("tilesblue", (0.45, 0.60, 0.70)),
    ("tilesgreen", (0.50, 0.65, 0.52)),
    ("tilestan", (0.75, 0.66, 0.52)),
    ("tile|checker|ceramic|plate|bowl|cup|mug|toilet", (0.80, 0.79, 0.77)),
    ("hotelcarpet|carpet|rug|doormat", (0.52, 0.45, 0.38)),
    ("lettuce|basil|leaves|plant|grass", (0.27, 0.45, 0.17)),
    ("soil|potting|dirt|coffee", (0.25, 0.17, 0.11)),
    ("apple|tomato", (0.70, 0.16, 0.10)),
    ("potato", (0.68, 0.52, 0.32)),
    ("egg", (0.90, 0.80, 0.66)),
    ("bread", (0.72, 0.50, 0.26)),
    ("cardboard|box", (0.66, 0.50, 0.33)),
    ("basketball", (0.76, 0.36, 0.13)),
    ("teddy", (0.60, 0.42, 0.24)),
    ("boots|bat|tennis", (0.40, 0.27, 0.18)),
    ("sponge", (0.70, 0.75, 0.25)),
    ("cellphone|laptop|screen|readout|window", (0.14, 0.15, 0.17)),
    ("paper|label|page|tissue|poster|newspaper", (0.88, 0.87, 0.83)),
    ("paint|photo|_s\\.jpg|1280|van_gogh|hopper|scene|landscape|modern|tree|flowers|english", (0.48, 0.46, 0.40)),
    ("book", (0.45, 0.28, 0.24)),
    ("copper|bronze|brass", (0.66, 0.42, 0.26)),
    ("iron|metal|steel|aluminum|aluminium|chrome", (0.60, 0.60, 0.61)),
    ("sofa|couch|armchair|ottoman|fabric|velvet|upholster|coat|bed|curtain", (0.55, 0.50, 0.45)),
    ("statue|vase|glass", (0.75, 0.75, 0.74)),
    ("pen|pencil", (0.78, 0.62, 0.18)),
)
TEXTURE_DEFAULT: Rgb = (0.62, 0.60, 0.57)

# Categories of which no asset lists materials: plausible colours, one asset one row.
CATEGORY_COLOURS: dict[str, tuple[str, ...]] = {
    "Book": ("7a2e2b ece6d6", "2f4a6d ece6d6", "3e5c3a ece6d6", "8a6a34 ece6d6", "4b3557 ece6d6", "c9b79a ece6d6"),
    "Television": ("17181a 2a2c30",),
    "Box": ("a98256 c19a6b", "9c7448 b58a5a"),
    "Egg": ("ead9bd", "d9b58c"),
    "LightSwitch": ("f0eee8",),
    "Sink": ("eceae6 a9abad", "d8d6d0 a9abad"),
    "ToiletPaperHanger": ("b9bbbd",),
    "Tomato": ("b3261a 4d7a2a", "c23a1f 4d7a2a"),
    "Faucet": ("b4b7ba", "8f9396"),
    "Doorframe": ("efece4", "8a6341"),
    "Cloth": ("8fa7b8", "c7b28f", "a06a62", "77876b"),
    "Newspaper": ("d8d4c8 55524c",),
    "CreditCard": ("2d5aa0 d9d9d9", "1f7a5c d9d9d9", "8a2433 d9d9d9"),
    "Candle": ("efe3c6 3a3128",),
    "DogBed": ("7d6650 c8b79f",),
    "ClothesDryer": ("e8e9ea 55585c",),
    "WashingMachine": ("e8e9ea 55585c",),
    "ShowerHead": ("b9bcc0",),
    "TeddyBear": ("9a6b3d c79a66",),
    "Toilet": ("f1f0ec",),
    "ToiletPaper": ("f2efe8",),
    "Blinds": ("e6e1d5",),
    "Boots": ("54381f 2c2119",),
    "DishSponge": ("d8c63a 4f8a3c",),
    "PaperTowelRoll": ("f2efe8 b99c74",),
    "TissueBox": ("7fa3bf f2efe8",),
}

# What an asset is made of where AI2-THOR says nothing: words in the names of its materials, or the group of ProcTHOR's
# material database that they are in; first match counts.
MATERIAL_WORDS: tuple[tuple[str, str], ...] = (
    ("leather", "leather"),
    ("fabr?ic|fabirc|velvet|cloth|cotton|blanket|sheet|pillow|carpet|cus[h]?ions|sofa", "fabric"),
    ("wood|oak|plank|wicker", "wood"),
    ("glass", "glass"),
    ("ceramic|porcelain", "ceramic"),
    ("metal|meta$|steel|alumin|iron|chrome|brass|copper|bronze|foil|gold|silver|tin$", "metal"),
    ("plastic|plasitc|rubber", "plastic"),
    ("marble|granite|concrete|stone", "stone"),
    ("cardboard|paper", "paper"),
    ("wax", "wax"),
)
MATERIAL_GROUPS = {"Fabric", "Glass", "Metal", "Paper", "Plastic", "Wax", "Wood"}
# Details that say little of the whole.
MATERIAL_DETAILS = "decal|logo|readout|screen|hole|screw|label|placeable|button|interior|transparen"


def main() -> None:
    """Reads DATA, writes `assets.json`, `categories.json`, `groups.json` and `materials.json`."""
    parser = argparse.ArgumentParser(description="Build evonav's asset catalogue.")
    parser.add_argument("data", type=Path, help="directory with procthor-databases/ and house files")
    parser.add_argument("--out", type=Path, default=Path("rust/evonav-core/data"))
    arguments = parser.parse_args()
    databases = arguments.data / "procthor-databases"
    assets: list[Json] = [a for group in read(databases / "asset-database.json").values() for a in group]
    albedo = read(arguments.data / "molmospaces-resources" / "material_to_textures.json")
    materials = {name: material_colour(name, facts) for name, facts in sorted(albedo.items())}
    surfaces = surface_heights(assets, houses(arguments.data))
    salient = salient_materials(databases / "ai2thor-object-metadata.json.gz")
    annotations = read(databases / "placement-annotations.json")
    receptacles = read(databases / "receptacles.json")

    rows = sorted(assets, key=lambda asset: str(asset["assetId"]))
    colours = asset_colours(rows, materials)
    write(arguments.out / "assets.json", "assets", [asset_row(a, surfaces, colours, salient) for a in rows])
    names = sorted({str(a["objectType"]) for a in rows})
    write(arguments.out / "categories.json", "categories", [category_row(n, annotations, receptacles) for n in names])
    groups = [group_row(path.stem, read(path)) for path in sorted((databases / "asset_groups").glob("*.json"))]
    write(arguments.out / "groups.json", "groups", groups)
    write(arguments.out / "materials.json", "materials", [[name, to_hex(rgb)] for name, rgb in materials.items()])


def read(path: Path) -> Any:  # noqa: ANN401
    """One JSON document."""
    return json.loads(path.read_text(encoding="utf-8"))


def write(path: Path, key: str, rows: Iterable[Any]) -> None:
    """One row a line: compact, and readable as a difference."""
    lines = ",\n".join(json.dumps(row, separators=(",", ":"), ensure_ascii=False) for row in rows)
    path.write_text(f'{{"credit":{json.dumps(CREDIT)},\n"{key}":[\n{lines}\n]}}\n', encoding="utf-8")


# --- surface heights -------------------------------------------------------------------------------------------------


def houses(data: Path) -> Iterator[Json]:
    """Every house under `data` that the real simulator filled."""
    for path in sorted(data.rglob("*.json*")):
        if "procthor-generated" in path.parts or "procthor-databases" in path.parts:
            continue
        text = gzip.decompress(path.read_bytes()).decode() if path.suffix == ".gz" else path.read_text("utf-8")
        is_lines = ".jsonl" in path.name
        documents = [json.loads(line) for line in text.splitlines() if line.strip()] if is_lines else [json.loads(text)]
        for document in documents:
            for house in document if isinstance(document, list) else [document]:
                if isinstance(house, dict) and "objects" in house and "rooms" in house:
                    yield house


def surface_heights(assets: Iterable[Json], recorded: Iterable[Json]) -> dict[str, list[float]]:
    """Heights above the box's bottom at which children rest, by asset id.

    Bottoms of children that the simulator dropped there (`small|...`) are clustered per asset; assets with few children
    take what their category shows, in parts of the asset's own height; receptacles of which nothing is known offer
    their top. Members of asset groups are not counted: the generator puts them on the box's top, so that pillows hang
    level with the bed's headboard.
    """
    by_id = {str(asset["assetId"]): asset for asset in assets}
    heights: dict[str, list[float]] = defaultdict(list)
    parts: dict[str, list[float]] = defaultdict(list)
    for house in recorded:
        for parent in house["objects"]:
            for child in parent.get("children", []):
                if not str(child["id"]).startswith("small|"):
                    continue
                if (asset := by_id.get(parent["assetId"])) and (held := by_id.get(child["assetId"])):
                    bottom = parent["position"]["y"] - size(asset)[1] / 2
                    height = child["position"]["y"] - turned_height(held, child["rotation"]) / 2 - bottom
                    # Lower or higher is a child that fell off, or stands on another child.
                    if 0.0 <= height <= size(asset)[1] + 0.03:
                        heights[parent["assetId"]].append(height)
                        parts[str(asset["objectType"])].append(height / size(asset)[1])
    surfaces = {}
    for name, asset in by_id.items():
        top = size(asset)[1]
        seen = without_hover(clusters(heights[name], gap=0.015, least=3, share=0.04))
        if not seen:
            category = clusters(parts[str(asset["objectType"])], gap=0.04, least=10, share=0.10)
            seen = without_hover([part * top for part in category])
        if not seen and "Receptacle" in asset.get("secondaryProperties", []):
            seen = [top]
        surfaces[name] = sorted({round(min(height, top), 3) for height in seen})
    return surfaces


def without_hover(rising: list[float]) -> list[float]:
    """Phones, laptops, vases and a few more rest exactly 5 cm above the surface that others rest on."""
    return [high for high in rising if not any(0.045 <= high - low <= 0.056 for low in rising)]


def size(asset: Json) -> tuple[float, float, float]:
    """Edge lengths x, y, z in metres."""
    box = asset["boundingBox"]
    return box["x"], box["y"], box["z"]


def turned_height(asset: Json, rotation: Json) -> float:
    """Height of the turned box (Unity Euler angles: about z, then x, then y)."""
    x, y, z = size(asset)
    pitch, roll = math.radians(rotation["x"]), math.radians(rotation["z"])
    in_x = abs(math.cos(pitch) * math.sin(roll)) * x
    in_y = abs(math.cos(pitch) * math.cos(roll)) * y
    return in_x + in_y + abs(math.sin(pitch)) * z


def clusters(values: list[float], *, gap: float, least: int, share: float) -> list[float]:
    """Medians of runs of values that are never `gap` apart, if `least` and a `share` of all values are in the run."""
    runs: list[list[float]] = []
    for value in sorted(values):
        if runs and value - runs[-1][-1] < gap:
            runs[-1].append(value)
        else:
            runs.append([value])
    return [statistics.median(run) for run in runs if len(run) >= max(least, share * len(values))]


# --- colours ---------------------------------------------------------------------------------------------------------


def material_colour(name: str, facts: Json) -> Rgb:
    """Albedo tint times the texture's mean. Glass is pale blue-grey whatever its tint."""
    red, green, blue, alpha = (float(part) for part in str(facts["albedo_rgba"]).split())
    if alpha < 0.5:
        return (0.80, 0.87, 0.90)
    if not facts["_MainTex"]:
        return (red, green, blue)
    mean = texture_mean(Path(str(facts["_MainTex"])).stem + " " + name)
    if min(red, green, blue) > 0.95:
        return mean
    # A tinted texture is mostly grey: only how light it is counts.
    light = max(0.45, 0.2126 * mean[0] + 0.7152 * mean[1] + 0.0722 * mean[2])
    return (red * light, green * light, blue * light)


def texture_mean(words: str) -> Rgb:
    """A guess: the textures are not published with the material facts."""
    plain = words.lower()
    return next((rgb for pattern, rgb in TEXTURE_WORDS if re.search(pattern, plain)), TEXTURE_DEFAULT)


def to_hex(rgb: Rgb) -> str:
    """`rrggbb`."""
    return "".join(f"{round(255 * min(1.0, max(0.0, channel))):02x}" for channel in rgb)


def asset_colours(assets: list[Json], materials: dict[str, Rgb]) -> dict[str, list[str]]:
    """Colours by asset id, the most important first.

    Assets without materials borrow those of one of their category, chosen by a checksum of the id.
    """
    own = {str(a["assetId"]): own_colours(a, materials) for a in assets}
    palettes: dict[str, list[list[str]]] = defaultdict(list)
    for asset in assets:
        if own[str(asset["assetId"])]:
            palettes[str(asset["objectType"])].append(own[str(asset["assetId"])])
    for category, rows in CATEGORY_COLOURS.items():
        palettes[category] = [row.split() for row in rows]
    for asset in assets:
        name, palette = str(asset["assetId"]), palettes[str(asset["objectType"])]
        if not own[name] and palette:
            own[name] = palette[zlib.crc32(name.encode()) % len(palette)]
    return own


def own_colours(asset: Json, materials: dict[str, Rgb]) -> list[str]:
    """Colours of the asset's materials: primary before secondary before details, each once."""

    def rank(material: str) -> int:
        words = material.lower()
        details = ("decal", "logo", "readout", "hole", "screw", "label", "placeable", "glass", "button")
        order = {"primary": 0, "secondary": 2, "tertiary": 3}
        if any(word in words for word in details):
            return 9
        return next((place for word, place in order.items() if word in words), 1)

    names = [name for _, name in asset.get("materials") or [] if "Placeable_Surface" not in name]
    return list(dict.fromkeys(to_hex(materials[name]) for name in sorted(names, key=rank)))


# --- materials -------------------------------------------------------------------------------------------------------


def salient_materials(path: Path) -> dict[str, list[str]]:
    """What AI2-THOR's metadata says that assets are made of, by asset id, the most important first."""
    found: dict[str, list[str]] = {}
    for scenes in json.loads(gzip.decompress(path.read_bytes())).values():
        for entry in (entry for scene in scenes for entry in scene):
            if entry["assetId"] and entry.get("salientMaterials"):
                found[str(entry["assetId"])] = [str(word).lower() for word in entry["salientMaterials"]]
    return found


def materials_named(materials: Iterable[tuple[str, str]]) -> list[str]:
    """What an asset is made of by its materials, given as pairs of group and name; at most two words, each once."""
    words: list[str] = []
    for group, name in materials:
        plain = name.lower()
        if re.search(MATERIAL_DETAILS, plain):
            continue
        by_group = group.lower() if group in MATERIAL_GROUPS else None
        word = next((word for pattern, word in MATERIAL_WORDS if re.search(pattern, plain)), by_group)
        if word is not None and word not in words:
            words.append(word)
    return words[:2]


# --- rows ------------------------------------------------------------------------------------------------------------


def asset_row(
    asset: Json, surfaces: dict[str, list[float]], colours: dict[str, list[str]], salient: dict[str, list[str]]
) -> Json:
    """Facts about one asset."""
    name = str(asset["assetId"])
    owned = [asset.get("primaryProperty"), *asset.get("secondaryProperties", [])]
    row: Json = {
        "id": name,
        "category": asset["objectType"],
        "size_m": [round(edge, 4) for edge in size(asset)],
        "split": asset["split"],
        "surfaces_m": surfaces[name],
        "colours": colours[name],
        "materials": [material for _, material in asset.get("materials") or []],
        "made_of": salient.get(name) or materials_named(asset.get("materials") or []),
    }
    row.update({flag: True for fact, flag in PROPERTIES.items() if fact in owned})
    return {key: value for key, value in row.items() if value not in (None, [])}


def category_row(category: str, annotations: dict[str, Json], receptacles: dict[str, Json]) -> Json:
    """Where a category is placed, and on what it was seen: share of that receptacle's instances that hold one."""
    row: Json = {"name": category}
    # The annotations are one table a fact, each from category to value.
    facts = {key: table.get(category) for key, table in annotations.items()}
    if facts["onFloor"] is not None or facts["onWall"] is not None:
        row["rooms"] = {room: facts[key] for room, key in ROOMS.items() if facts[key]}
        row["where"] = [place for place, key in WHERE.items() if facts[key]]
        row["is_kinematic"] = bool(facts["isKinematic"])
        row["is_structure"] = bool(facts["isStructure"])
        row["multiple_per_room"] = bool(facts["multiplePerRoom"])
    supports = {on: round(held[category]["p"], 4) for on, held in sorted(receptacles.items()) if category in held}
    if supports:
        row["supports"] = supports
    return row


def group_row(name: str, group: Json) -> Json:
    """An asset group: where it stands, and how each member is put to its parent; parents come first.

    In the frame of the first member, seen from above: x right, z forward. `anchor` is the side of the parent's box that
    a member is at (-1, 0, 1 along x and z), `align` the side of that line on which its own box lies, `offset_m` is
    added; `turn_deg` is its yaw, give or take `spread_deg`. ProcTHOR mirrors x when it reads its files, and so do we.
    """
    members: list[Json] = []

    def add(node: Json, parent: int | None) -> None:
        facts = group["assetMetadata"][str(node["instanceId"])]
        place = facts["position"]
        row: Json = {"category": next(iter(facts["assetIds"])), "spread_deg": facts["randomness"]["dtheta"]}
        if parent is not None:
            anchor = int(place["relativeAnchorToParent"])
            row |= {
                "parent": parent,
                "is_above": place["verticalAlignment"] == "above",
                "anchor": [1 - anchor % 3, anchor // 3 - 1],
                "align": [place["xAlignment"] - 1, place["zAlignment"] - 1],
                "offset_m": [round(0.0 - place["x"], 4), round(place["z"], 4)],
                "turn_deg": facts["rotation"],
            }
        members.append(row)
        index = len(members) - 1
        for child in node.get("children", []):
            add(child, index)

    for node in group["treeData"]:
        add(node, None)
    location = group["groupProperties"]["location"]
    return {
        "name": name,
        "where": [place for place in ("corner", "middle", "edge") if location[place]],
        "members": members,
    }


if __name__ == "__main__":
    main()
