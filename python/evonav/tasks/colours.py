"""Name colours: the describer's words, which decision models that look use as well."""

import colorsys


def colour_word(colour: tuple[int, int, int]) -> str:
    """Return the nearest of `evonav.tasks.language.COLOURS`, by hue unless the colour is a grey.

    Args:
        colour: sRGB in even white light, 0 to 255.
    """
    hue, lightness, saturation = colorsys.rgb_to_hls(*(channel / 255.0 for channel in colour))
    hue_deg = 360.0 * hue
    chroma = saturation * (1.0 - abs(2.0 * lightness - 1.0))
    if lightness < 0.12:
        return "black"
    if chroma < 0.09:
        return "black" if lightness < 0.2 else "grey" if lightness < 0.78 else "white"
    if hue_deg < 16.0 or hue_deg >= 345.0:
        is_dull = chroma < 0.36
        return "pink" if lightness > (0.6 if is_dull else 0.7) else "brown" if is_dull else "red"
    if hue_deg < 46.0:
        if lightness > 0.6 and chroma < 0.45:
            return "beige"
        return "orange" if chroma > 0.6 and lightness > 0.4 else "brown"
    if hue_deg < 68.0:
        return "yellow" if chroma > 0.3 else "beige" if lightness > 0.6 else "green"
    if hue_deg < 170.0:
        return "green"
    if hue_deg < 255.0:
        return "blue"
    return "purple" if hue_deg < 305.0 else "pink"
