"""For all tests."""

import signal

from hypothesis import settings
from recorded_runs import viewed_run, write_run  # noqa: F401 - fixtures

# A shell that starts pytest in the background has it, and all that the tests start, ignore interrupts.
signal.signal(signal.SIGINT, signal.default_int_handler)

# The same examples every time, as in the Rust tests (Makefile), and no limit of time for one on a busy machine.
settings.register_profile("evonav", derandomize=True, deadline=None)
settings.load_profile("evonav")
