"""A worker that its parent ends, ends silently."""

import subprocess
import sys

CALLBACK = """
import os, signal, time, weakref
from evonav.parallel.local import end_with_parent

class Collected:
    pass

end_with_parent(os.pipe()[0])
collected = Collected()
reference = weakref.ref(collected, lambda _: signal.raise_signal(signal.SIGTERM))
del collected
time.sleep(20)
print("still here")
"""


def test_a_worker_that_is_ended_in_a_callback_of_the_collector_ends_and_prints_nothing() -> None:
    """Python prints what such a callback raises, and goes on."""
    done = subprocess.run([sys.executable, "-c", CALLBACK], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (143, "", "")
