"""Define the base of all settings, apart from the settings so that small commands start without what those import."""

from evonav.errors import InvalidArgumentError
from evonav.tasks.records import Record

NUM_RETRIES = 2
"""Number of retries of a stage that lost its worker, its simulator or its agent's process."""


class SettingError(InvalidArgumentError):
    """A setting that is invalid beside the others; the command and sweep files add its full name."""

    def __init__(self, settings: "type[Settings]", key: str, problem: str) -> None:
        """Create the error.

        Args:
            key: A field of the settings.
            problem: The problem, as the end of a sentence that begins with the field's name.
        """
        super().__init__(f"{key} {problem}")
        self.settings = settings
        self.key = key
        self.problem = problem


class Settings(Record):
    """Options that people write, in a file or on the command line.

    The string below a field is its description in the JSON Schema of sweep files and in the command's help.
    """
