"""Words for perceptions: read, refused, and written back."""

import pytest

from evonav.errors import InvalidArgumentError
from evonav.perception.shorthand import GROUND_TRUTH, NOISY, PREDICTED, parse_perception, short_name_of

WORDS = {
    "gt": (GROUND_TRUTH, {}),
    "noisy": (NOISY, {}),
    "noisy:poor": (NOISY, {"preset": "poor"}),
    "noisy:poor,miss_rate=0.3,features=false": (NOISY, {"preset": "poor", "miss_rate": 0.3, "features": False}),
    "noisy,confusion=own.toml": (NOISY, {"confusion": "own.toml"}),
    "predicted:unigoal": (PREDICTED, {"stack": "unigoal"}),
    "mine.sight:Sight,far_m=3": ("mine.sight:Sight", {"far_m": 3}),
}


@pytest.mark.parametrize("word", WORDS)
def test_words_say_what_is_made_and_can_be_said_again(word: str) -> None:
    read = parse_perception(word)
    assert (read.path, dict(read.options)) == WORDS[word]
    assert short_name_of(read.path, read.options) == word


def test_a_device_is_no_part_of_what_is_recorded() -> None:
    read = parse_perception("predicted:unigoal,device=cpu")
    assert (read.options, read.host_options) == ({"stack": "unigoal"}, {"device": "cpu"})
    assert short_name_of(read.path, read.options) == "predicted:unigoal"


def test_options_go_before_those_of_the_word() -> None:
    assert parse_perception("noisy:good,miss_rate=0.3", {"miss_rate": 0.5}).options == {
        "preset": "good",
        "miss_rate": 0.5,
    }


@pytest.mark.parametrize(
    ("word", "said"),
    {
        "yolo": r"'yolo': expected gt, noisy\[:PRESET\]",
        "nosy": "did you mean noisy",
        "": "expected gt",
        "gt:poor": "gt has no variants",
        "gt,miss_rate=1": "gt has no variants",
        "noisy:": "nothing after the colon",
        "noisy:poor,miss_rate": "'miss_rate': expected each KEY=VALUE once",
        "noisy:poor,miss_rate=0.1,miss_rate=0.2": "'miss_rate=0.2': expected each KEY=VALUE once",
        "predicted:3dmem": "no stack '3dmem'.*did you mean 3d-mem",
    }.items(),
)
def test_bad_words_are_named_with_what_is_known(word: str, said: str) -> None:
    with pytest.raises(InvalidArgumentError, match=said):
        parse_perception(word)
