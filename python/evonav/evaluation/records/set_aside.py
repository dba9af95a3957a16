"""Set aside records that earlier versions stored although nothing can read them, so that a run can go on."""

import os
import warnings

from pydantic import ValidationError

from evonav.evaluation.records.encoded import invalid_record
from evonav.evaluation.records.schema import ErrorKind, StageFailure, StageRecord
from evonav.evaluation.records.store import RunStore

FILE_NAME = "set_aside.jsonl"
"""File in the run's folder with these records as they were stored, one a line."""
CHECKED_KEY = "are_records_valid"
"""Place in a run's header that says that every record was validated, when it was stored or later."""


def set_aside_invalid(store: RunStore) -> list[str]:
    """Move records that are not valid to a file, so that their stages are run again; warn of each.

    An agent that said NaN could once bring such a record about. The later stages of its episode go with it: they are
    run again, too. `RunStore.failures` keeps the reason.

    Returns:
        A sentence for each record.

    Raises:
        StoreError: The file cannot be read or written.
    """
    if store.meta(CHECKED_KEY):
        return []
    found: list[str] = []
    for agent, task_id, stage in sorted(store.states()):
        text = store.record_text(agent, task_id, stage)
        if text is None:  # forgotten with an earlier stage
            continue
        try:
            StageRecord.model_validate_json(text)
        except ValidationError as error:
            found.append(invalid_record(text, error))
            with (store.path.parent / FILE_NAME).open("a", encoding="utf-8") as file:
                file.write(text + "\n")
                file.flush()
                os.fsync(file.fileno())
            store.forget_episode(agent, task_id, stage)
            store.add_retry(agent, task_id, StageFailure(stage, ErrorKind.HARNESS, found[-1]))
            warnings.warn(f"{store.path}: {found[-1]}; it is set aside in {FILE_NAME}", stacklevel=2)
    return found
