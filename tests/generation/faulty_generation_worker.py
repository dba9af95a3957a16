"""A generation worker that fails on purpose, at the houses and in the ways that `$EVONAV_TEST_FAULTS` gives."""

import json
import os
import time
from pathlib import Path

from evonav.generation import worker


def make_worker(settings, alive):
    """Return the function of `evonav.generation.worker.make_worker`, with faults."""
    faults = json.loads(os.environ["EVONAV_TEST_FAULTS"])
    work = worker.make_worker(settings, alive)

    def faulty(text):
        index, _ = json.loads(text.partition("\n")[0])
        fault = faults.get(str(index))
        if fault == "die":
            os._exit(7)
        if fault is not None and fault.startswith("die once "):
            flag = Path(fault.removeprefix("die once "))
            if not flag.exists():
                flag.touch()
                os._exit(7)
        if fault == "hang":
            time.sleep(600.0)
        if fault == "raise":
            raise RuntimeError("a defect")
        return work(text)

    return faulty
