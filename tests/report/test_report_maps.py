import math
import re
from pathlib import Path
from xml.etree import ElementTree

import draw_episode
import pytest
from made_up_run import NEW_TABLE_M, WriteRun, entry, floor_plan, record_run, stage_record

from evonav.drawing.floor_plan import label_point
from evonav.drawing.style import file_css, map_css
from evonav.drawing.svg import Point, polyline, simplified, slug
from evonav.errors import InvalidArgumentError
from evonav.evaluation.records.schema import EndState
from evonav.report.maps.stage_map import stage_svg
from evonav.report.maps.trajectory import rounds as choices
from evonav.report.pages.replays import highlight_task
from evonav.report.run import load_run

SVG = "{http://www.w3.org/2000/svg}"


def with_class(root: ElementTree.Element, name: str) -> list[ElementTree.Element]:
    return [element for element in root.iter() if name in element.get("class", "").split()]


def drawn(stage: int = 2, state: EndState = EndState.FAILURE) -> ElementTree.Element:
    stale = entry("Plate", (2.3, 0.8, 2.0), is_stale=True)
    record = stage_record("fu", "t", stage, state, chosen=stale, entries=[stale])
    maps = {k: floor_plan("t", k) for k in (1, 2)}
    return ElementTree.fromstring(stage_svg(record, maps, success_radius_m=1.5))


def test_the_house_is_drawn_to_scale() -> None:
    root = drawn()
    assert len(with_class(root, "floor")) == 2
    assert len(with_class(root, "kitchen")) == 1
    # Both sides of the inner wall are one line.
    (walls,) = with_class(root, "walls")
    assert len(list(walls)) == 5
    assert len(list(with_class(root, "doors")[0])) == 1
    assert len(list(with_class(root, "windows")[0])) == 1
    # 9 m x 4 m with 0.4 m around, z up the page.
    assert root.get("viewBox") == "-40 -440 980 480"
    (kitchen,) = with_class(root, "kitchen")
    assert kitchen.get("d") == "M0 0v-400h500v400z"


def test_target_ring_and_ends_are_where_the_record_says() -> None:
    root = drawn()
    (ring,) = with_class(root, "ring")
    at = (round(100 * (NEW_TABLE_M[0] + 0.3)), round(-100 * NEW_TABLE_M[2]))
    assert (ring.get("cx"), ring.get("cy"), ring.get("r")) == (str(at[0]), str(at[1]), "150")
    (start,) = with_class(root, "start")
    assert (start.get("cx"), start.get("cy")) == ("100", "-100")
    (end,) = with_class(root, "end")
    circle = end.find(f"{SVG}circle")
    assert circle is not None
    assert (circle.get("cx"), circle.get("cy")) == ("400", "-100")
    assert "bad" in end.get("class", "")
    assert "ok" in with_class(drawn(state=EndState.SUCCESS), "end")[0].get("class", "")
    # The target moved, so its first place is marked as well; in stage 1 it is not.
    assert len(with_class(root, "star")) == 2
    assert len(with_class(drawn(stage=1), "star")) == 1


def test_change_is_ghosts_and_one_arrow_for_table_and_plate() -> None:
    root = drawn()
    assert len(with_class(with_class(root, "ghost")[0], "item")) == 2
    assert len(with_class(with_class(root, "moved")[0], "item")) == 2
    arrows = with_class(root, "arrow")
    assert [arrow.find(f"{SVG}title").text for arrow in arrows] == ["dining table: moved 5.1 m"]  # type: ignore[union-attr]
    assert with_class(drawn(stage=1), "change") == []


def test_the_path_has_a_piece_a_round_and_stale_entries_are_marked() -> None:
    root = drawn()
    pieces = with_class(root, "r")
    assert len(pieces) == 4
    assert [piece.get("class", "").split()[1] for piece in pieces] == ["t0", "t2", "t5", "t7"]
    assert pieces[0].get("data-p") == f"100,-100,{round(math.degrees(0.5))}"
    (visited,) = with_class(root, "visited")
    assert "plate" in (visited.findtext(f"{SVG}title") or "")
    fresh = stage_record("fu", "t", 2, EndState.SUCCESS, entries=[entry("Plate", (7.3, 0.8, 3.0), is_stale=False)])
    assert with_class(ElementTree.fromstring(stage_svg(fresh, {})), "stale") == []


def test_a_stage_without_house_or_trace_is_still_drawn() -> None:
    record = stage_record("fu", "t", 1, EndState.NOT_RUN)
    root = ElementTree.fromstring(stage_svg(record, {}))
    assert with_class(root, "star")
    assert with_class(root, "floor") == []


def test_the_picture_of_the_readme_has_a_row_an_agent(write_run: WriteRun, tmp_path: Path, monkeypatch) -> None:
    words = [str(write_run()), "task-0", "fu,ftu", "1,2", str(tmp_path / "images" / "strip.svg")]
    monkeypatch.setattr("sys.argv", ["draw_episode.py", *words])
    draw_episode.main()
    root = ElementTree.parse(words[-1]).getroot()
    assert [element.text for element in with_class(root, "stage")] == ["Stage 1", "Stage 2"]
    assert [element.text for element in with_class(root, "ink")] == ["fu", "fu", "ftu", "ftu"]
    assert [element.text for element in with_class(root, "verdict")[1]] == ["fu", "failure"]
    assert len(root.findall(f".//{SVG}svg")) == 4
    assert [ring.get("r") for ring in with_class(root, "ring")] == ["150"] * 4 + ["9"]  # four maps, and the legend
    assert "retained group in the kitchen: 2 objects moved" in "".join(root.itertext())


def test_the_first_highlight_is_a_task_where_memory_misleads(write_run: WriteRun, tmp_path: Path) -> None:
    assert highlight_task(load_run(write_run()), ["fu", "ftu"]) == "task-0"
    records = [
        stage_record("fu", task_id, 1, state, num_stages=1, chosen=entry("Plate", (2.3, 0.8, 2.0), is_stale=is_stale))
        for task_id, state, is_stale in (
            ("a", EndState.SUCCESS, False),
            ("b", EndState.FAILURE, True),
            ("c", EndState.SUCCESS, True),
        )
    ]
    run = load_run(record_run(tmp_path / "one", records, dict.fromkeys("abc", 1), ["fu"]))
    assert highlight_task(run, ["fu"]) == "b"
    with pytest.raises(InvalidArgumentError, match="no task has records of ftu"):
        highlight_task(run, ["ftu"])


def test_files_write_colours_out() -> None:
    assert "var(" not in file_css()
    assert "--" not in file_css()
    # Light and dark have the same names, and every name that a rule uses.
    light, dark, rules = map_css().split("/* --- */")
    names = {frozenset(re.findall(r"--(\w+):", block)) for block in (light, dark)}
    assert len(names) == 1
    assert set(re.findall(r"var\(--(\w+)\)", rules)) <= names.pop()


def test_rounds_are_told_in_runs() -> None:
    stale = entry("DiningTable", (0, 0, 0), is_stale=True)
    record = stage_record("fu", "t", 1, EndState.FAILURE, chosen=stale)
    assert choices(record.trace) == ["dining table #7 (stale) ×3", "dining table #7 (stale), stop"]


def test_slugs_are_safe_and_differ() -> None:
    names = ["a", "a/b", "a_b", "../a", "a b", "", ".", "é", "x" * 300, "x" * 301, "con\x00trol", "a\\b"]
    slugs = [slug(name) for name in names]
    assert len(set(slugs)) == len(names)
    assert slugs[0] == "a"
    for found in slugs:
        assert re.fullmatch(r"[A-Za-z0-9_-][A-Za-z0-9._-]*", found)
        assert len(found) <= 100


def test_simplified_keeps_ends_and_corners() -> None:
    assert simplified([(0, 0), (25, 0), (50, 1), (100, 0), (100, 80)]) == [(0, 0), (100, 0), (100, 80)]
    assert simplified([(0, 0), (50, 30), (0, 0)]) == [(0, 0), (50, 30), (0, 0)]
    assert polyline([(0, 0), (100, 0), (100, 80), (90, 70)]) == "M0 0h100v80l-10 -10"
    assert polyline([(3, 4)]) == "M3 4h0"


@pytest.mark.parametrize(
    ("polygon_m", "least_gap_m"),
    [
        ([(0, 0), (0, 8), (2, 8), (2, 2), (8, 2), (8, 0)], 0.8),
        ([(0, 0), (0, 6), (1, 6), (1, 1), (7, 1), (7, 6), (8, 6), (8, 0)], 0.35),
        ([(0, 0), (4, 6), (8, 0)], 1.5),
        ([(5, 5), (5, 9), (12, 9), (12, 5)], 1.8),
    ],
)
def test_labels_lie_well_inside_rooms_of_any_shape(polygon_m: list[Point], least_gap_m: float) -> None:
    x, z = label_point(polygon_m)
    edges = list(zip(polygon_m, polygon_m[1:] + polygon_m[:1], strict=True))
    # Winding number: the angle under which the edges are seen adds up to a full turn from inside, to nothing outside.
    turn = 0.0
    for a, b in edges:
        angle = math.atan2(b[1] - z, b[0] - x) - math.atan2(a[1] - z, a[0] - x)
        turn += (angle + math.pi) % math.tau - math.pi
        along = [(a[0] + t * (b[0] - a[0]) / 50, a[1] + t * (b[1] - a[1]) / 50) for t in range(51)]
        assert min(math.dist((x, z), point) for point in along) >= least_gap_m
    assert abs(turn) == pytest.approx(math.tau)
