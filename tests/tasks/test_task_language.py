from evonav.house import bundled_houses
from evonav.tasks.language import noun_of


def test_nouns_are_words_that_people_use() -> None:
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
