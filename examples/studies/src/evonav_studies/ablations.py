"""Belief-Weighted Search without one of its parts, for `examples/sweeps/proactive-ablation.toml`."""

from functools import partial

from evonav.agents.proactive.agent import Proactive
from evonav.agents.proactive.config import ProactiveConfig

without_text = partial(Proactive, ProactiveConfig(uses_text=False))
"""Goal text as evidence of change."""
without_identity = partial(Proactive, ProactiveConfig(checks_identity=False))
"""Stops at other instances."""
without_see_through = partial(Proactive, ProactiveConfig(sees_through=False))
"""Evidence on the way."""
without_rooms = partial(Proactive, ProactiveConfig(uses_rooms=False))
"""Evidence shared inside a room."""
without_explaining_away = partial(Proactive, ProactiveConfig(explains_away=False))
"""Trust restored elsewhere."""
without_in_room_mass = partial(Proactive, ProactiveConfig(searches_rooms=False))
"""The room outlives the pose."""
without_hazard = partial(Proactive, ProactiveConfig(expects_change=False))
"""Doubt before evidence."""
without_anchors = partial(Proactive, ProactiveConfig(uses_anchors=False))
"""Search near what the text names."""
without_room_prior = partial(Proactive, ProactiveConfig(weighs_rooms=False))
"""Exploration by type of room."""
without_sectors = partial(Proactive, ProactiveConfig(gates_sectors=False))
"""Calibration."""
without_reserve = partial(Proactive, ProactiveConfig(keeps_reserve=False))
"""Stages that run out of rounds."""
without_hysteresis = partial(Proactive, ProactiveConfig(keeps_choice=False))
"""Ways back and forth."""
