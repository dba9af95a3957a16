"""For all tests."""

import signal

# A shell that starts pytest in the background has it, and all that the tests start, ignore interrupts.
signal.signal(signal.SIGINT, signal.default_int_handler)
