"""Tables of perceptions: what they find, what they take it for, and the memory that comes of it."""

import csv
import io
from collections.abc import Mapping, Sequence

from evonav.perception_benchmark.other_scores import Group
from evonav.perception_benchmark.scores import COMPARED, COMPARED_MEMORY, Scores, differences
from evonav.report.tables.table import NONE, Table
from evonav.statistics import Estimate

MAX_CATEGORIES, MAX_CONFUSIONS = 8, 4
INTERVALS = "[..]: 95% interval, bootstrap by house."


def perception_tables(found: Sequence[Scores], *, is_brief: bool = False) -> list[Table]:
    """Return all tables, in reading order.

    Args:
        found: Scores, one per perception.
        is_brief: Brief tables for a terminal: of categories, the most frequent alone.
    """
    tables = [
        _headline(found),
        _differences(found),
        _parts(found),
        *(_by_group(found, by, name) for by, name in (("distance", "distance"), ("size", "size in the image"))),
        _by_outline(found),
        _categories(found, MAX_CATEGORIES if is_brief else None),
        _confusions(found, MAX_CONFUSIONS if is_brief else 4 * MAX_CONFUSIONS),
        _memory(found),
        _staleness(found),
        _beliefs(found),
        _features(found),
    ]
    return [table for table in tables if table.rows]


def percent(estimate: Estimate | None, *, has_n: bool = False) -> str:
    """Return a share in percent with its interval."""
    if estimate is None or estimate.value is None:
        return NONE
    text = f"{100 * estimate.value:.1f}"
    if estimate.ci95 is not None:
        text += " [{:.1f}, {:.1f}]".format(*(100 * end for end in estimate.ci95))
    return f"{text} ({estimate.n})" if has_n else text


def points(estimate: Estimate | None) -> str:
    """Return a difference of shares in points with its interval."""
    if estimate is None or estimate.value is None:
        return NONE
    text = f"{100 * estimate.value:+.1f}"
    if estimate.ci95 is not None:
        text += " [{:+.1f}, {:+.1f}]".format(*(100 * end for end in estimate.ci95))
    return text


def number(estimate: Estimate | None, decimals: int = 2) -> str:
    """Return a number with its interval."""
    if estimate is None or estimate.value is None:
        return NONE
    text = f"{estimate.value:.{decimals}f}"
    if estimate.ci95 is not None:
        text += f" [{estimate.ci95[0]:.{decimals}f}, {estimate.ci95[1]:.{decimals}f}]"
    return text


def _headline(found: Sequence[Scores]) -> Table:
    names = ("ap50", "ap", "precision", "recall", "f1")
    heads = ("AP50", "AP", "precision", "recall", "F1", "objects", "detections")
    rows = tuple(
        (
            one.word,
            *(percent(one.overall.get(name)) for name in names),
            str(one.overall["recall"].n),
            str(one.overall["precision"].n),
        )
        for one in found
    )
    first = found[0]
    notes = (
        f"{first.num_tasks} tasks in {first.num_houses} houses, {first.num_views} views each perception. {INTERVALS}",
        "In %, at IoU 0.5 and with the right label; AP: mean over IoU 0.5 to 0.95.",
    )
    return Table("What perceptions find", ("perception", *heads), rows, notes)


def _differences(found: Sequence[Scores]) -> Table:
    heads = ("AP50", "AP", "precision", "recall", "F1", "located", "memory precision", "memory recall")
    rows = tuple(
        (f"{each.word} less {each.less}", *(points(each.measures.get(name)) for name in (*COMPARED, *COMPARED_MEMORY)))
        for each in differences(found)
    )
    note = f"In points. {INTERVALS} Of the same views; not adjusted for how many are compared."
    return Table("Perceptions against each other", ("perceptions", *heads), rows, (note,))


def _parts(found: Sequence[Scores]) -> Table:
    names = ("located", "labelled", "iou", "ap50_located")
    rows = tuple((one.word, *(percent(one.overall.get(name)) for name in names)) for one in found)
    note = (
        "In %. Located: objects at whose place something is told (IoU 0.5), whatever its label. Label right, mean IoU: "
        "of those. Places alone: AP50 if all labels were right."
    )
    return Table(
        "Places and labels apart", ("perception", "located", "label right", "mean IoU", "places alone"), rows, (note,)
    )


def _by_group(found: Sequence[Scores], by: str, quantity: str) -> Table:
    names = [group.name for group in found[0].groups[by]]
    rows = tuple(
        (one.word, measure, *(percent(group.measures.get(measure), has_n=True) for group in one.groups[by]))
        for one in found
        for measure in ("recall", "precision")
    )
    note = (
        f"In % (n). {INTERVALS} Recall: by the true object's {quantity}; "
        "precision: by the detection's own, as perceived."
    )
    return Table(f"By {quantity}", ("perception", "", *names), rows, (note,))


def _by_outline(found: Sequence[Scores]) -> Table:
    rows = tuple(
        (one.word, *(percent(group.measures.get("recall"), has_n=True) for group in one.groups["outline"]))
        for one in found
    )
    names = [group.name for group in found[0].groups["outline"]]
    note = "In % (n), by the part of the object's outline that is cut by nothing nearer, nor by the image's border."
    return Table("Recall by how much is in the way", ("perception", *names), rows, (note,))


def _categories(found: Sequence[Scores], most: int | None) -> Table:
    by_word = [{group.name: group.measures for group in one.groups["category"]} for one in found]
    names = [group.name for group in found[0].groups["category"]]
    measures = ("recall", "precision", "ap50", "labelled")
    rows = tuple(
        (
            name if i == 0 else "",
            one.word,
            str(mine[name]["recall"].n),
            str(mine[name]["precision"].n),
            *(percent(mine[name][measure]) for measure in measures),
        )
        for name in names[:most]
        for i, (one, mine) in enumerate(zip(found, by_word, strict=True))
    )
    columns = ("category", "perception", "objects", "detections", "recall", "precision", "AP50", "label right")
    left = "" if most is None or len(names) <= most else f" The {most} most frequent of {len(names)}."
    return Table("By category", columns, rows, (f"In %. {INTERVALS}{left}",))


def _confusions(found: Sequence[Scores], most: int) -> Table:
    rows: list[tuple[str, ...]] = []
    for one in found:
        rows += [
            (one.word, each.category, each.label, str(each.num), percent(each.share, has_n=True))
            for each in one.confusions[:most]
        ]
        rows += [(one.word, "(nothing)", label, str(num), NONE) for label, num in one.unexplained[: most // 2]]
    note = f"The most frequent. {INTERVALS}"
    columns = ("perception", "object", "told as", "times", "of the objects %")
    return Table("What is taken for what", columns, tuple(rows), (note,))


def _memory(found: Sequence[Scores]) -> Table:
    shares = ("surplus", "wrong_label", "phantoms")
    heads = (
        "entries",
        "objects seen",
        "precision %",
        "recall %",
        "error m",
        "surplus %",
        "wrong label %",
        "phantoms %",
    )
    rows = tuple(
        (
            one.word,
            number(one.memory["entries"], 1),
            number(one.memory["seen"], 1),
            percent(one.memory["memory_precision"]),
            percent(one.memory["memory_recall"]),
            number(one.memory["position_error_m"]),
            *(percent(one.memory[name]) for name in shares),
        )
        for one in found
    )
    notes = (
        "After the first house's tour, a house. Precision: an object of the entry's label stands within 0.3 m of it; "
        "recall: of objects seen from at most 3.5 m. Error: middle to middle, of entries with their object's label.",
        "Surplus: entries beyond an object's first, per object; wrong label: of entries with an object; phantoms: most "
        "of the entry's detections were of no object.",
    )
    return Table("The memory of objects that comes of it", ("perception", *heads), rows, notes)


def _staleness(found: Sequence[Scores]) -> Table:
    rows = tuple(
        (one.word, *(percent(one.memory[name], has_n=True) for name in ("stale_at_start", "stale_after_tour")))
        for one in found
        if one.memory["stale_at_start"].n
    )
    note = "Entries that were right in the house before and are not in this one; in % of all entries (n)."
    return Table("Stale entries in the next house", ("perception", "as it begins", "after its tour"), rows, (note,))


def _beliefs(found: Sequence[Scores]) -> Table:
    columns = ("perception", "ECE %", "depth error %", "depth RMSE m", "depth lost %", "offset m", "turn °")
    rows = tuple(
        (
            one.word,
            percent(one.overall["ece"]),
            percent(one.overall["depth_relative"]),
            number(one.overall["depth_rmse_m"], 3),
            percent(one.overall["depth_lost"]),
            number(one.overall["pose_offset_m"], 3),
            number(one.overall["pose_turn_deg"]),
        )
        for one in found
    )
    note = (
        "ECE: mean gap between confidence and precision, in tenths of confidence. Depth error: mean of |error| / depth."
    )
    return Table("Confidence, depth and pose", columns, rows, (note,))


def _features(found: Sequence[Scores]) -> Table:
    names = ("same_object", "same_category", "other", "text_own", "text_other")
    rows = tuple(
        (
            one.word,
            *(number(one.overall.get(f"cosine_{name}"), 3) for name in names),
            percent(one.overall.get("text_right"), has_n=True),
        )
        for one in found
        if one.cosines
    )
    columns = ("perception", "same object", "same category", "other", "its word", "other words", "nearest word right %")
    return Table("Cosines of features", columns, rows)


def perception_csv(found: Sequence[Scores]) -> str:
    """Return every number as a CSV row, unrounded."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("perception", "by", "group", "measure", "value", "low", "high", "n", "num_houses"))

    def write(word: str, by: str, group: str, measures: Mapping[str, Estimate]) -> None:
        for name, each in measures.items():
            low, high = each.ci95 or ("", "")
            value = "" if each.value is None else each.value
            writer.writerow((word, by, group, name, value, low, high, each.n, found[0].num_houses))

    for each in differences(found):
        write(each.word, "less", each.less, each.measures)
    for one in found:
        write(one.word, "", "", one.overall)
        write(one.word, "memory", "", one.memory)
        for share, measures in one.memory_curve:
            write(one.word, "memory by share of the tour", f"{share:g}", measures)
        groups: dict[str, Sequence[Group]] = {**one.groups, "depth": one.depth}
        for by, rows in groups.items():
            for group in rows:
                write(one.word, by, group.name, group.measures)
        for pair in one.confusions:
            write(one.word, "confusion", f"{pair.category} as {pair.label}", {"share": pair.share})
    return text.getvalue()
