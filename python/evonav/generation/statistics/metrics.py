"""List the metrics over tasks, with their labels and the paper's values."""

from evonav.tasks.statistics import Metric, Range, Unit


def _metric(
    key: str,
    label: str,
    group: str,
    unit: Unit = "share",
    *,
    paper: float | None = None,
    expected: float | None = None,
    accepted: Range | None = None,
) -> Metric:
    """Return a metric over no tasks yet."""
    return Metric(
        key=key,
        label=label,
        group=group,
        unit=unit,
        n=0,
        raw=None,
        interval="bootstrap",
        paper=paper,
        expected=expected,
        accepted=accepted,
    )


_EVOLUTION, _GOALS, _OBJECTS, _TASKS = "Evolution", "Goals of stages 2 and on", "Objects", "Tasks"
_DURING = "Changes during stages"

# `paper`: Sec. 3.2 and its plot. `expected` of evolutions: binomial, K uniform on {3, 4, 5}. Other `expected`: a trial
# of Algorithm 1 in ProcTHOR-10k's mix, without images and rejected goals (docs/studies/task-statistics.md).
METRICS = (
    _metric("evolved_once", "tasks with an evolution", _EVOLUTION, paper=0.859, expected=0.8542),
    _metric("evolved_twice", "tasks with two or more", _EVOLUTION, paper=0.484, expected=0.4792),
    _metric("static", "static transitions", _EVOLUTION, paper=0.494, expected=0.5),
    _metric("unchanged", "triggered, but nothing moved", _EVOLUTION),
    _metric("mode_SALIENT_OBJECT", "by SALIENT_OBJECT", _EVOLUTION, paper=0.5),
    _metric("mode_RETAIN_GROUP", "by RETAIN_GROUP", _EVOLUTION, paper=0.4),
    _metric("mode_FULL_SHUFFLE", "by FULL_SHUFFLE", _EVOLUTION, paper=0.1),
    _metric("room_again", "same room as just before", _EVOLUTION, expected=0.036, accepted=(0.03, 0.05)),
    _metric("goal_relocated", "relocated before", _GOALS, paper=0.379, expected=0.39, accepted=(0.36, 0.41)),
    _metric("goal_in_changed_room", "in the room just changed", _GOALS, expected=0.795),
    _metric("goal_moved", "moved by the change", _GOALS, expected=0.685),
    _metric("goal_moved_SALIENT_OBJECT", "  if SALIENT_OBJECT", _GOALS, expected=0.575),
    _metric("goal_moved_RETAIN_GROUP", "  if RETAIN_GROUP", _GOALS, expected=0.795),
    _metric("goal_moved_FULL_SHUFFLE", "  if FULL_SHUFFLE", _GOALS, expected=0.8),
    _metric("goal_is_salient", "the salient object itself", _GOALS),
    _metric("goal_room_again", "in the previous goal's room", _GOALS),
    _metric("goal_again", "an earlier goal of the task", _GOALS),
    _metric("goal_relocated_all", "relocated before, all stages", _GOALS, expected=0.295),
    _metric("relocated_ratio", "median relocated ratio", _OBJECTS, "median share", accepted=(0.1, 0.2)),
    _metric("ratio_zero", "tasks with none relocated", _OBJECTS, expected=0.1458),
    _metric("ratio_above_80", "tasks above 80%", _OBJECTS),
    _metric("room_relocated", "relocated in changed room", _OBJECTS),
    _metric("room_relocated_SALIENT_OBJECT", "  if SALIENT_OBJECT", _OBJECTS),
    _metric("room_relocated_RETAIN_GROUP", "  if RETAIN_GROUP", _OBJECTS),
    _metric("room_relocated_FULL_SHUFFLE", "  if FULL_SHUFFLE", _OBJECTS),
    _metric("unmoved", "found no other place", _OBJECTS),
    _metric("unmoved_RETAIN_GROUP", "  if RETAIN_GROUP", _OBJECTS),
    _metric("unmoved_FULL_SHUFFLE", "  if FULL_SHUFFLE", _OBJECTS),
    _metric("during", "stages with a change", _DURING),
    _metric("during_target", "  that moved the target", _DURING),
    _metric("num_stages", "stages per task", _TASKS, "stages", paper=4.010, expected=4.0),
    _metric("goals_refused", "goals rejected per stage", _TASKS, "goals"),
)

RATIOS = tuple(metric for metric in METRICS if metric.unit != "median share")
"""Metrics that are ratios of sums over tasks."""
MEDIANS = tuple(metric for metric in METRICS if metric.unit == "median share")
"""Metrics that are medians of a quantity."""
OF_TASKS = ("evolved_once", "evolved_twice", "ratio_zero", "ratio_above_80")
"""Keys of metrics for which each task is one trial, so that Wilson's interval is valid."""

DISTRIBUTIONS = {
    "num_evolutions": "Evolutions per task",
    "modes": "Modes of evolutions",
    "modes_drawn": "Modes drawn, applied or not",
    "relocated_ratio": "Share of objects relocated by the end",
    "during_modes": "Modes of changes during stages",
    "outcomes": "Outcomes of transitions",
    "failures": "Reasons why a triggered change failed",
    "num_stages": "Stages per task",
    "num_rooms": "Rooms per house",
    "goal_rooms": "Rooms of goals",
    "goal_scores": "Target scores of goals",
    "goal_rejections": "Reasons for rejected goals",
    "house_rejections": "Reasons for houses without a task",
    "goal_categories": "Categories of goals",
    "house_categories": "Categories of objects",
}

QUANTITIES = {
    "relocated_ratio": ("Share of objects relocated by the end", "share"),
    "displacement_m": ("Displacement of relocated objects", "m"),
    "during_round": ("Round of changes during stages", "rounds"),
    "path_m": ("Reference path of a stage", "m"),
    "task_path_m": ("Reference path of a task", "m"),
    "reference_distance_m": ("Reference pose to target", "m"),
    "visible_px": ("Target in the reference image", "px"),
    "basic_words": ("Basic instruction", "words"),
    "appearance_words": ("Appearance instruction", "words"),
    "unified_words": ("Unified instruction", "words"),
    "num_rooms": ("Rooms per house", "rooms"),
    "num_objects": ("Objects per house", "objects"),
}

PAPER_EVOLUTIONS = (0.1458, 0.3750, 0.3333, 0.1250, 0.0208)
"""Computed shares of tasks with 0 to 4 evolutions; the paper gives 14.1% with none and 48.4% with two or more."""
PAPER_MODES = (0.5, 0.4, 0.1)
"""The paper's chances of the three modes."""
