"""The bundled houses are fit for use: every room is reached, and nothing small has fallen off its support."""

from build_houses import fallen_ids, unreached_rooms

from evonav.house import bundled_houses
from evonav.world.embedded import EmbeddedSimulator

MIN_HOUSES = 24


def test_every_room_is_reached_and_nothing_has_fallen() -> None:
    simulator = EmbeddedSimulator()
    num_houses = 0
    for house in bundled_houses():
        simulator.reset(house.to_json())
        assert not unreached_rooms(simulator, house), house.name
        assert not fallen_ids(simulator, house), house.name
        assert len(house.rooms) >= 2, house.name
        num_houses += 1
    assert num_houses >= MIN_HOUSES
