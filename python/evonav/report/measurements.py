"""Keep the records of a benchmark in a folder: measure what is missing on many workers, and read what is there.

The memory benchmark, the perception benchmark and the speed benchmark write and read their files by this module.
"""

import gzip
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from evonav.errors import StoreError
from evonav.parallel.pool import Job, answers, open_pool
from evonav.parallel.worker import Workforce
from evonav.records import sentence_of

J = TypeVar("J")
M = TypeVar("M", bound=BaseModel)


class MeasurementRecord(BaseModel):
    """A part of a file, without unknown keys; infinity and NaN are strings."""

    model_config = ConfigDict(extra="forbid", ser_json_inf_nan="strings")


def finished(
    work: str, settings: str, jobs: Sequence[J], text_of: Callable[[J], str], *, num_workers: int, timeout_s: float
) -> Iterator[tuple[J, str | None, str]]:
    """Run jobs on workers, in the order in which they end.

    Args:
        num_workers: Number of processes; 0 runs everything in this one.
        timeout_s: Time without a sign of life after which a job is given up.

    Yields:
        The job, its answer or `None`, and the last line of what went wrong.
    """
    if not jobs:
        return
    with open_pool(work, settings, Workforce(min(num_workers, len(jobs))), timeout_s=timeout_s) as pool:
        texts = (Job(key, text_of(job)) for key, job in enumerate(jobs))
        for answer in answers(pool, texts):
            if answer.failure is None:
                yield jobs[answer.key], answer.text, ""
            else:
                yield jobs[answer.key], None, (answer.detail.strip().splitlines() or [answer.failure])[-1]


def read_model(model: type[M], path: Path, advice: str) -> M:
    """Read a JSON file, which may be gzipped.

    Args:
        advice: End of the message if it cannot be read: what was expected, or what to do.

    Raises:
        StoreError: It cannot be read, or a field is wrong; the message has file, field and value.
    """
    try:
        data = path.read_bytes()
        return model.model_validate_json(gzip.decompress(data) if path.suffix == ".gz" else data)
    except ValidationError as error:
        raise StoreError(f"{path}: {sentence_of(error)}; {advice}") from None
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror or error}; {advice}") from error
    except (EOFError, zlib.error) as error:
        raise StoreError(f"{path}: cannot be read: {error}; {advice}") from error
