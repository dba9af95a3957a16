"""Check the modes that Gymnasium's users choose by name."""

from gymnasium.vector import AutoresetMode

from evonav.errors import InvalidArgumentError

RENDER_MODES = ("rgb_array",)
"""Modes of `render`. Gymnasium makes `rgb_array_list` and `human` of it, by wrappers of its own."""


def check_render_mode(mode: str | None) -> None:
    """Refuse a render mode that does not exist.

    Raises:
        InvalidArgumentError: It does not exist.
    """
    if mode is None or mode in RENDER_MODES:
        return
    hint = {
        "human": "; for a window use `gymnasium.make`, which opens one with pygame",
        "rgb_array_list": "; for a list of pictures use `gymnasium.make`",
        "camera": "; choose the picture with `render_view`",
        "map": "; choose the picture with `render_view`",
    }.get(mode, "")
    raise InvalidArgumentError(f"argument `render_mode` is {mode!r}, expected 'rgb_array' or None{hint}")


def autoreset_mode(mode: AutoresetMode | str) -> AutoresetMode:
    """Return the mode of a name.

    Raises:
        InvalidArgumentError: It is neither `NEXT_STEP` nor `SAME_STEP`.
    """
    expected = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)
    for known in expected:
        if mode in (known, known.value):
            return known
    names = " or ".join(repr(known.value) for known in expected)
    raise InvalidArgumentError(f"argument `autoreset_mode` is {mode!r}, expected {names}")
