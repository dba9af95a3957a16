from evonav.house import bundled_houses
from evonav.tasks.language import listed, noun_of, plural_of, with_article


def test_nouns_are_common_words() -> None:
    nouns = {
        "DiningTable": "dining table",
        "TVStand": "TV stand",
        "CD": "CD",
        "ArmChair": "armchair",
        "CounterTop": "countertop",
        "Mug": "mug",
        "LivingRoom": "living room",
        "ToiletPaperHanger": "toilet paper hanger",
    }
    assert {category: noun_of(category) for category in nouns} == nouns


def test_no_two_categories_share_a_noun() -> None:
    categories = {entry.category for house in bundled_houses() for entry in house.objects if entry.category}
    assert len(categories) > 60
    assert len({noun_of(category) for category in categories}) == len(categories)


def test_plurals_and_articles() -> None:
    plurals = {
        "shelf": "shelves",
        "open shelf": "open shelves",
        "butter knife": "butter knives",
        "watch": "watches",
        "box": "boxes",
        "potato": "potatoes",
        "TV stand": "TV stands",
        "CD": "CDs",
        "remote control": "remote controls",
        "key": "keys",
        "berry": "berries",
        "blinds": "blinds",
        "toilet paper": "toilet paper",
    }
    assert {noun: plural_of(noun) for noun in plurals} == plurals
    nouns = ("armchair", "mug", "TV stand", "aluminum foil", "blinds", "egg")
    assert [with_article(noun) for noun in nouns] == [
        "an armchair",
        "a mug",
        "a TV stand",
        "some aluminum foil",
        "some blinds",
        "an egg",
    ]
    assert [listed(list(words)) for words in ("", "a", "ab", "abc")] == ["", "a", "a and b", "a, b and c"]
