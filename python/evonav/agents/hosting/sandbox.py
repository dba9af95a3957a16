"""Shut an agent's process in: what it cannot read, reach or start, however its code tries.

Linux only: Landlock decides which files can be opened, a seccomp filter refuses system calls, and limits of the system
bound its memory and files. All of it holds for the process's children and cannot be undone by it. The process calls
`restrict` before it runs any of the agent's code. See docs/reliability.md for what remains open.
"""

import ctypes
import json
import os
import platform
import struct
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from evonav.errors import InvalidArgumentError

MAX_FILE_BYTES = 1 << 30
"""Largest file that a process may write."""
MAX_OPEN_FILES = 1024
MAX_TASKS = 4096
"""Largest number of processes and threads of the user; the system does not hold root to it."""


@dataclass(frozen=True, slots=True)
class Policy:
    """The files and the memory that a process may use; all else is refused."""

    read: tuple[str, ...]
    """Files and folders whose contents it may read and execute."""
    names: tuple[str, ...]
    """Folders in which it may list names, also in folders below, but read nothing."""
    write: tuple[str, ...]
    """Folders in which it may do anything with files."""
    memory_mb: int
    """Largest address space."""


_IS_LINUX = sys.platform == "linux"
_LIBC = ctypes.CDLL(None, use_errno=True) if _IS_LINUX else None

# Landlock: linux/landlock.h. All rights of version 1, then those that later versions added.
_EXECUTE, _WRITE_FILE, _READ_FILE, _READ_DIR = 1, 2, 4, 8
_FILE_RIGHTS_BY_ABI = ((1, (1 << 13) - 1), (2, 1 << 13), (3, 1 << 14), (5, 1 << 15))
_TRUNCATE, _IOCTL_DEV = 1 << 14, 1 << 15
_NET_ABI, _NET_RIGHTS = 4, 3
_SCOPE_ABI, _SCOPES = 6, 3  # abstract UNIX sockets, signals
_FOR_FILES = _EXECUTE | _WRITE_FILE | _READ_FILE | _TRUNCATE | _IOCTL_DEV
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_DEVICES = ("/dev/null", "/dev/zero", "/dev/full", "/dev/random", "/dev/urandom")
_GPUS = ("/dev/dri", "/dev/kfd", *(f"/dev/nvidia{name}" for name in ("", "0", "1", "2", "3", "ctl", "-uvm", "-caps")))

# seccomp: numbers of system calls by machine. x86_64, aarch64.
_AUDIT_ARCH = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}
_CALLS = {
    "ptrace": (101, 117),
    "process_vm_readv": (310, 270),
    "process_vm_writev": (311, 271),
    "kcmp": (312, 272),
    "pidfd_open": (434, 434),
    "pidfd_getfd": (438, 438),
    "socket": (41, 198),
    "io_uring_setup": (425, 425),  # would open files and sockets past the filter
    "io_uring_enter": (426, 426),
    "io_uring_register": (427, 427),
    "setsid": (112, 157),  # children stay in the group that ends with the agent
    "setpgid": (109, 154),
    "unshare": (272, 97),
    "setns": (308, 268),
    "mount": (165, 40),
    "umount2": (166, 39),
    "pivot_root": (155, 41),
    "chroot": (161, 51),
    "open_tree": (428, 428),
    "move_mount": (429, 429),
    "fsopen": (430, 430),
    "fsconfig": (431, 431),
    "fsmount": (432, 432),
    "mount_setattr": (442, 442),
    "name_to_handle_at": (303, 264),
    "open_by_handle_at": (304, 265),
    "bpf": (321, 280),
    "perf_event_open": (298, 241),
    "userfaultfd": (323, 282),
    "keyctl": (250, 219),
    "add_key": (248, 217),
    "request_key": (249, 218),
    "kexec_load": (246, 104),
    "kexec_file_load": (320, 294),
    "init_module": (175, 105),
    "finit_module": (313, 273),
    "delete_module": (176, 106),
    "reboot": (169, 142),
    "swapon": (167, 224),
    "swapoff": (168, 225),
    "acct": (163, 89),
    "quotactl": (179, 60),
    "syslog": (103, 116),
}
_CLONE, _CLONE3 = (56, 220), 435
_NEW_NAMESPACES = 0x7E020000
_EPERM, _ENOSYS = 1, 38
_NO_NEW_PRIVS, _SET_SECCOMP, _FILTER_MODE = 38, 22, 2
_GET_SECCOMP = 21

_status: int | None = None
"""Descriptor of `/proc/self/status`, opened before `/proc` is shut."""


def landlock_abi() -> int:
    """Return the version of Landlock that this system offers; 0 without it."""
    if _LIBC is None:
        return 0
    return max(0, int(_LIBC.syscall(_CREATE_RULESET, None, 0, 1)))


def sandbox_problem() -> str | None:
    """Return why this system has no sandbox for agents, in a few words; `None` if it has one."""
    if not _IS_LINUX:
        return "it needs Linux"
    if platform.machine() not in _AUDIT_ARCH:
        return f"it knows no machine of type {platform.machine()}"
    if not landlock_abi():
        return "this kernel offers no Landlock (Linux 5.13 or newer, switched on)"
    if _LIBC is not None and _LIBC.prctl(_GET_SECCOMP, 0, 0, 0, 0) < 0:
        return "this kernel offers no seccomp"
    return None


def begin(socket_fd: int) -> None:
    """Read the policy of this process from its connection, as `Policy` in JSON after its size, and shut it in."""
    global _status
    size = int.from_bytes(_exactly(socket_fd, 8), "little")
    policy = Policy(**json.loads(_exactly(socket_fd, size)))
    _status = os.open("/proc/self/status", os.O_RDONLY | os.O_CLOEXEC)
    restrict(policy)


def own_status() -> str:
    """Return the text of `/proc/self/status`, also where `/proc` is shut; `OSError` if the system has no such file."""
    return Path("/proc/self/status").read_text() if _status is None else os.pread(_status, 1 << 16, 0).decode()


def _exactly(descriptor: int, size: int) -> bytes:
    data = b""
    while len(data) < size:
        part = os.read(descriptor, size - len(data))
        if not part:
            raise ConnectionResetError("closed")
        data += part
    return data


def restrict(policy: Policy) -> None:
    """Shut this process in, for good; `InvalidArgumentError` if the system cannot, or another thread is running."""
    if reason := sandbox_problem():
        raise InvalidArgumentError(f"isolation = sandbox: {reason}")
    num_threads = len(list(Path("/proc/self/task").iterdir()))
    if num_threads != 1:  # it would stay free, and could be made to work for the agent
        raise InvalidArgumentError(f"isolation = sandbox: {num_threads} threads are running as the process begins")
    _limit(policy.memory_mb)
    _call("prctl", _NO_NEW_PRIVS, 1, 0, 0, 0)
    _restrict_files(policy)
    _restrict_calls()


def _limit(memory_mb: int) -> None:
    import resource

    limits = {
        resource.RLIMIT_AS: memory_mb << 20,
        resource.RLIMIT_FSIZE: MAX_FILE_BYTES,
        resource.RLIMIT_NOFILE: MAX_OPEN_FILES,
        resource.RLIMIT_NPROC: MAX_TASKS,
        resource.RLIMIT_CORE: 0,
    }
    for kind, limit in limits.items():
        _, most = resource.getrlimit(kind)
        bounded = limit if most == resource.RLIM_INFINITY else min(limit, most)
        resource.setrlimit(kind, (bounded, bounded))


def _call(name: str, *arguments: object) -> int:
    """Call a function of the C library."""
    done = int(getattr(_LIBC, name)(*arguments))
    if done < 0:
        raise InvalidArgumentError(f"isolation = sandbox: {name}: {os.strerror(ctypes.get_errno())}")
    return done


def _restrict_files(policy: Policy) -> None:
    abi = landlock_abi()
    handled = sum(rights for since, rights in _FILE_RIGHTS_BY_ABI if abi >= since)
    sizes = 8 if abi < _NET_ABI else 16 if abi < _SCOPE_ABI else 24
    attributes = struct.pack("=QQQ", handled, _NET_RIGHTS, _SCOPES)[:sizes]
    ruleset = _call("syscall", _CREATE_RULESET, attributes, len(attributes), 0)
    reading = _EXECUTE | _READ_FILE | _READ_DIR
    rules: list[tuple[Sequence[str], int]] = [
        (policy.read, reading),
        (policy.names, _READ_DIR),
        (policy.write, handled),
        (_DEVICES, _READ_FILE | _WRITE_FILE),
        (_GPUS, _READ_FILE | _WRITE_FILE | _READ_DIR | _IOCTL_DEV),
    ]
    try:
        for paths, rights in rules:
            for path in paths:
                _allow(ruleset, path, rights & handled)
        _call("syscall", _RESTRICT_SELF, ruleset, 0)
    finally:
        os.close(ruleset)


def _allow(ruleset: int, path: str, rights: int) -> None:
    """Add a rule for a path and what is below it; one that is not there needs none."""
    try:
        place = os.open(path, os.O_PATH | os.O_CLOEXEC)  # type: ignore[attr-defined,unused-ignore]  # Linux
    except OSError:
        return
    try:
        is_folder = os.path.isdir(path)  # noqa: PTH112 - a text
        rule = struct.pack("=Qi", rights if is_folder else rights & _FOR_FILES, place)
        _call("syscall", _ADD_RULE, ruleset, 1, rule, 0)
    finally:
        os.close(place)


def _restrict_calls() -> None:
    code = b"".join(_program())

    class Program(ctypes.Structure):
        _fields_ = (("length", ctypes.c_ushort), ("filter", ctypes.c_char_p))

    program = Program(len(code) // 8, code)
    _call("prctl", _SET_SECCOMP, _FILTER_MODE, ctypes.byref(program), 0, 0)


def _program() -> Iterator[bytes]:
    """Yield the filter's instructions: refused calls return an error, all others pass."""
    load, equal, at_least, any_bit, answer = 0x20, 0x15, 0x35, 0x45, 0x06
    pass_on, refuse, kill = 0x7FFF0000, 0x00050000, 0x80000000

    def step(code: int, value: int, if_true: int = 0, if_false: int = 0) -> bytes:
        return struct.pack("=HBBI", code, if_true, if_false, value)

    machine = list(_AUDIT_ARCH).index(platform.machine())
    yield step(load, 4)  # the kind of machine that the call is of
    yield step(equal, _AUDIT_ARCH[platform.machine()], 1, 0)
    yield step(answer, kill)
    yield step(load, 0)  # the number of the call
    yield step(at_least, 0x40000000, 0, 1)  # x32: other numbers for the same calls
    yield step(answer, refuse | _EPERM)
    for numbers in _CALLS.values():
        yield step(equal, numbers[machine], 0, 1)
        yield step(answer, refuse | _EPERM)
    yield step(equal, _CLONE3, 0, 1)  # its flags cannot be read here; libraries fall back to `clone`
    yield step(answer, refuse | _ENOSYS)
    yield step(equal, _CLONE[machine], 0, 3)
    yield step(load, 16)  # its flags
    yield step(any_bit, _NEW_NAMESPACES, 0, 1)
    yield step(answer, refuse | _EPERM)
    yield step(answer, pass_on)
