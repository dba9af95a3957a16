"""Tell models, in all prompts or in none, that things may have been moved since they were last seen.

The paper's agents are not informed of changes (Sec. 4.1), so that by default no prompt says it.
"""

from collections.abc import Mapping
from typing import Any

from evonav.decision.prompts import Prompt, Text, Turn

CHANGE_NOTICE = "Things in this home may have been moved since the robot last saw them."
"""The sentence with which all prompts of an informed model begin, whatever the agent."""
_PLAIN, _FORMER = "searches a home. ", "searches a home in which things may have been moved since they were last seen. "


def with_notice(prompt: Prompt, tells_of_change: bool | None) -> Prompt:
    """Return a prompt as a model is shown it.

    Args:
        prompt: A question's prompt, which does not speak of changes.
        tells_of_change: True begins it with `CHANGE_NOTICE`. `None` is for runs recorded before there was the option:
            the main questions of Frontier-Update, its variants and MSGNav told of changes in words of their own.
    """
    if tells_of_change is False:
        return prompt
    first, *others = prompt.turns
    if tells_of_change:
        return Prompt((Turn(first.role, (Text(CHANGE_NOTICE), *first.parts)), *others), prompt.schema)
    parts = (Text(part.text.replace(_PLAIN, _FORMER)) if isinstance(part, Text) else part for part in first.parts)
    return Prompt((Turn(first.role, tuple(parts)), *others), prompt.schema)


def recorded_notice(path: str, options: Mapping[str, Any]) -> bool | None:
    """Return what a run told its model of changes, by the decision model's path and options in the run's header."""
    if path.endswith((":text_match", ":appearance_match")):  # they read no prompts
        return False
    recorded: bool | None = options.get("tells_of_change")
    return recorded
