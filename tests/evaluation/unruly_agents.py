"""Agents that misbehave from stage 2 on, in ways that only a process of their own contains."""

import ctypes
import gc
import hashlib
import os
import socket
import sys
import time
from pathlib import Path

import numpy as np
from toy_agents import Explorer

from evonav.agents.agent import EntryBelief, NavigateTo, Stop
from evonav.agents.explanation import Explanation
from evonav.decision.question import DecisionModel
from evonav.errors import DecisionError, SimulatorLostError


class Unruly(Explorer):
    """Does `mischief` in every round of stage 2."""

    def act(self, observation):
        if self.stage == 2:
            self.mischief()
        return super().act(observation)

    def mischief(self):
        raise NotImplementedError


class Undecided(Unruly):
    def mischief(self):
        raise DecisionError("no key")


class Pretending(Unruly):
    """An error of the evaluator's own does not make the failure the evaluator's."""

    def mischief(self):
        raise SimulatorLostError("gone")


class Exiting(Unruly):
    def mischief(self):
        sys.exit(5)


class Segfaulting(Unruly):
    def mischief(self):
        ctypes.string_at(0)


class Hanging(Unruly):
    """In C, with the interpreter's lock."""

    def mischief(self):
        ctypes.PyDLL(None).sleep(60)


class Forking(Unruly):
    """Both come back from `act`; there is one answer."""

    def mischief(self):
        os.fork()


class LeavingChildren(Unruly):
    """Dies, and leaves a child that holds all its descriptors."""

    def mischief(self):
        if os.fork() == 0:
            time.sleep(60)
        os._exit(3)


class Babbling(Unruly):
    """Finds the socket to the evaluator, and writes to it."""

    def mischief(self):
        for thing in gc.get_objects():
            if isinstance(thing, socket.socket):
                thing.sendall((20).to_bytes(8, "little") + b"cos\nsystem\n(S'true'\nt")


class Promising(Babbling):
    """Begins an answer of which the rest never comes."""

    def mischief(self):
        for thing in gc.get_objects():
            if isinstance(thing, socket.socket):
                thing.sendall((1000).to_bytes(8, "little") + b"{")
        time.sleep(60)


class Boasting(Babbling):
    """Announces more than any memory holds."""

    def mischief(self):
        for thing in gc.get_objects():
            if isinstance(thing, socket.socket):
                thing.sendall((2**60).to_bytes(8, "little"))
        time.sleep(60)


class Deaf(Unruly):
    def mischief(self):
        os.closerange(3, 100)


class Shrinking(Unruly):
    """Makes the shared memory shorter, if it can: who then writes to it is killed."""

    def mischief(self):
        for descriptor in range(3, 100):
            try:
                os.ftruncate(descriptor, 0)
            except OSError:
                continue


class Hungry(Unruly):
    def mischief(self):
        np.ones((1 << 40) // 8)


class Printing(Unruly):
    def mischief(self):
        print("a word on standard output")
        os.write(2, b"and one on standard error\n")
        sys.stdout.write("x" * 200_000 + "\n")


class Unmakeable(Explorer):
    def __init__(self):
        raise RuntimeError("not today")


class Farthest(Explorer):
    """Goes where no house is, but the number is finite."""

    def act(self, observation):
        return NavigateTo((1e5, -1e5)) if self.stage == 2 else super().act(observation)


class Keeping(Explorer):
    """Keeps what it was shown, changes half of it, and looks whether the rest is as it was."""

    def __init__(self):
        super().__init__()
        self.kept = []

    def act(self, observation):
        arrays = [
            array
            for view in observation.views
            for array in (view.depth_m, view.detections.masks, view.occupancy.free, view.occupancy.blocked)
        ]
        assert all(array.flags.writeable for array in arrays)
        for array, digest in self.kept:
            assert hashlib.sha256(array.tobytes()).hexdigest() == digest
        self.kept += [(array, hashlib.sha256(array.tobytes()).hexdigest()) for array in arrays[::2]]
        action = super().act(observation)
        for array in arrays[1::2]:
            array[...] = 7
        return action


class Echo:
    """Says what arrays it was given."""

    sensors = Explorer().sensors
    seen = ()

    def begin_task(self, task):
        pass

    def begin_stage(self, goal):
        pass

    def act(self, observation):
        arrays = [a for view in observation.views for a in (view.depth_m, view.rgb, view.detections.features)]
        self.seen = [
            None if a is None else [a.shape, str(a.dtype), hashlib.sha256(a.tobytes()).hexdigest()] for a in arrays
        ]
        return Stop(f"{len(observation.views)} views")

    def explain(self):
        return Explanation(details={"seen": self.seen}, objects=self.entries)

    def entries(self):
        return []


class Counting(Echo):
    """Remembers how many rounds it has acted, and cannot say so after the third."""

    def __init__(self):
        self.num_rounds = 0

    def act(self, observation):
        self.num_rounds += 1
        return super().act(observation)

    def entries(self):
        if self.num_rounds == 3:
            raise RuntimeError("who am I?")
        return [EntryBelief(self.num_rounds, "Mug", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 1)]


class Amnesiac(Explorer):
    def explain(self):
        return Explanation(objects=self.entries)

    def entries(self):
        if self.stage == 2:
            raise RuntimeError("who am I?")
        return []


class Announcing(Explorer):
    """Writes its process's number and that of a child to the file named by TOY_PIDS, then hangs."""

    def act(self, observation):
        child = os.fork()
        if child == 0:
            time.sleep(600)
        path = Path(os.environ["TOY_PIDS"])
        path.with_suffix(".part").write_text(f"{os.getpid()} {child}")
        path.with_suffix(".part").rename(path)
        time.sleep(600)


class Fatal(DecisionModel):
    """A decision model that ends its process when it is asked what stage 1 cost."""

    def __init__(self, seed):
        self.num_asked = 0

    def answer(self, question, attempt=0):
        raise AssertionError("nobody asks")

    def costs(self):
        self.num_asked += 1
        if self.num_asked == 1 and not os.path.exists(os.environ["TOY_ALIVE"]):  # noqa: PTH110
            open(os.environ["TOY_ALIVE"], "w").close()  # noqa: PTH123
            os._exit(3)
        return {}
