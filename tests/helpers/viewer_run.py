"""A small run whose model is a script that looks at images, for tests of the viewer."""

import re

from scripted_model import Scripted

from evonav.decision.question import AnswerError

MARKUP = "<b>bold</b> & </script> reasons"


def scripted(seed):
    """Explores first, then goes to what is offered; its third answer is a refusal, its fourth is none."""
    count = 0

    def script(question):
        nonlocal count
        count += 1
        if count == 3:
            raise AnswerError("refusal", "I would rather not", "I would rather not")
        if count == 4:
            return "To the kitchen, please"
        texts = [part for turn in question.prompt().turns for part in turn.parts if isinstance(part, str)]
        names = re.findall(r"^(Object \d+|Frontier \d+):", "\n".join(texts), re.MULTILINE)
        wanted = [name for name in names if name.startswith("Frontier" if count < 8 else "Object")]
        return f"{(wanted or names or ['Frontier 0'])[0]}\n{MARKUP}"

    return Scripted(script, needs_images=True)
