"""Say what colours assets have and what they are made of, for `build_asset_catalogue.py`."""

from __future__ import annotations

import gzip
import json
import re
import zlib
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeAlias

Json: TypeAlias = dict[str, Any]
Rgb: TypeAlias = tuple[float, float, float]

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
