"""A vision-language model of your own, in 30 lines.

    PYTHONPATH=examples evonav evaluate --decision own_vlm:OwnVlm --agent fu --limit 1 --out out/own

This one looks at brightness alone. Put your model where it does: `prompt.parts` are words and images in order, the last
words say how to answer. What it answers is kept in OUT/exchanges.sqlite, and `--set decision.mode=replay` has it again.
"""

import re

from evonav.decision.prompts import Picture, Prompt


class OwnVlm:
    """Goes where it is bright; believes that an object is still there."""

    needs = frozenset({"images"})

    def ask(self, prompt: Prompt) -> str:
        """The first line is the answer, the second a reason."""
        if '"yes" or "no"' in prompt.text:
            return "yes\nI believe what I remember."
        candidates: dict[str, float] = {}
        title = None
        for part in prompt.parts:
            if isinstance(part, Picture):
                if title is not None:
                    candidates[title] = float(part.pixels.mean())
                title = None
            elif found := re.search(r"((?:Object|Frontier) \d+):[^:\n]*$", part):
                title = found[1]
        brightest = max(candidates, key=candidates.__getitem__, default="Frontier 0")
        return f"{brightest}\nIt is the brightest of {len(candidates)}."
