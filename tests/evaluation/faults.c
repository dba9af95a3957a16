/* For tests: fails or kills at the n-th call that changes what is under a folder, and writes down what was changed.
 *
 * Loaded with LD_PRELOAD; nothing happens before `faults_arm`. Calls are counted that could lose something: opening to
 * create, writing, truncating, syncing, renaming, unlinking, making folders. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

enum { COUNT = 0, KILL = 1, FAIL = 2, FAIL_ALL = 3 };

static char under[4096];
static long at, calls;
static int mode, fault_errno, is_armed;
static int log_fd = -1;

/* number: the first call that is hit, from 1 on. KILL ends the process half-way through a write and before anything
 * else; FAIL has that one call fail with `error`, FAIL_ALL that one and all after it that need room. */
void faults_arm(const char *folder, int how, long number, int error) {
    snprintf(under, sizeof under, "%s", folder);
    mode = how;
    at = number;
    fault_errno = error;
    calls = 0;
    is_armed = 1;
}

long faults_calls(void) { return calls; }

/* From here on, what is changed is written to a file: a line `op path offset size`, then so many bytes. */
void faults_log(int fd) { log_fd = fd; }

static void note(const char *op, const char *path, long long offset, const void *data, size_t size) {
    if (log_fd < 0) return;
    static ssize_t (*real)(int, const void *, size_t);
    if (!real) real = (ssize_t(*)(int, const void *, size_t))dlsym(RTLD_NEXT, "write");
    char head[4400];
    int length = snprintf(head, sizeof head, "%s %s %lld %zu\n", op, path, offset, size);
    if (real(log_fd, head, length) != length || (size && real(log_fd, data, size) != (ssize_t)size)) abort();
}

void faults_mark(const char *text) { note("mark", text, 0, "", 0); }

static int is_under(const char *path) { return strncmp(path, under, strlen(under)) == 0; }

static char *path_of(int fd) {
    static char path[4096];
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t size = readlink(link, path, sizeof path - 1);
    path[size < 0 ? 0 : size] = 0;
    return path;
}

static int is_ours(int fd) { return is_armed && is_under(path_of(fd)); }

/* Whether this call is to fail; `needs_room` is of those that a full disk refuses. */
static int hit(int needs_room) {
    calls++;
    if (mode == KILL && calls == at) raise(SIGKILL);
    if ((mode == FAIL && calls == at) || (mode == FAIL_ALL && calls >= at && needs_room)) {
        errno = fault_errno;
        return 1;
    }
    return 0;
}

#define REAL(name, type, ...) \
    static type (*real)(__VA_ARGS__); \
    if (!real) real = (type(*)(__VA_ARGS__))dlsym(RTLD_NEXT, #name)

ssize_t write(int fd, const void *data, size_t size) {
    REAL(write, ssize_t, int, const void *, size_t);
    if (is_ours(fd)) {
        if (mode == KILL && calls + 1 == at && size > 1) real(fd, data, size / 2);
        if (hit(1)) return -1;
        off_t offset = lseek(fd, 0, fcntl(fd, F_GETFL) & O_APPEND ? SEEK_END : SEEK_CUR);
        note("write", path_of(fd), offset, data, size);
    }
    return real(fd, data, size);
}

#define PWRITE(name, offset_type) \
    ssize_t name(int fd, const void *data, size_t size, offset_type offset) { \
        REAL(name, ssize_t, int, const void *, size_t, offset_type); \
        if (is_ours(fd)) { \
            if (mode == KILL && calls + 1 == at && size > 1) real(fd, data, size / 2, offset); \
            if (hit(1)) return -1; \
            note("write", path_of(fd), offset, data, size); \
        } \
        return real(fd, data, size, offset); \
    }
PWRITE(pwrite, off_t)
PWRITE(pwrite64, off64_t)

/* On a descriptor; `offset` is what the log says of it. */
#define ON_FD(name, op, needs_room, offset, parameters, arguments) \
    int name parameters { \
        static int(*real) parameters; \
        if (!real) real = (int(*) parameters)dlsym(RTLD_NEXT, #name); \
        if (is_ours(fd)) { \
            if (hit(needs_room)) return -1; \
            note(op, path_of(fd), offset, "", 0); \
        } \
        return real arguments; \
    }
ON_FD(fsync, "sync", 0, 0, (int fd), (fd))
ON_FD(fdatasync, "sync", 0, 0, (int fd), (fd))
ON_FD(ftruncate, "truncate", 1, size, (int fd, off_t size), (fd, size))
ON_FD(ftruncate64, "truncate", 1, size, (int fd, off64_t size), (fd, size))

int posix_fallocate(int fd, off_t offset, off_t size) {
    REAL(posix_fallocate, int, int, off_t, off_t);
    return is_ours(fd) && hit(1) ? fault_errno : real(fd, offset, size);
}

int rename(const char *from, const char *to) {
    REAL(rename, int, const char *, const char *);
    if (is_armed && is_under(to)) {
        if (hit(1)) return -1;
        note("rename", from, 0, to, strlen(to));
    }
    return real(from, to);
}

int unlink(const char *path) {
    REAL(unlink, int, const char *);
    if (is_armed && is_under(path)) {
        if (hit(0)) return -1;
        note("unlink", path, 0, "", 0);
    }
    return real(path);
}

int mkdir(const char *path, mode_t rights) {
    REAL(mkdir, int, const char *, mode_t);
    return is_armed && is_under(path) && hit(1) ? -1 : real(path, rights);
}

static int opens(const char *path, int flags) {
    if (!is_armed || !(flags & O_CREAT) || !is_under(path)) return 0;
    if (hit(1)) return 1;
    note(flags & O_TRUNC ? "empty" : "create", path, 0, "", 0);
    return 0;
}

#define OPEN(name) \
    int name(const char *path, int flags, ...) { \
        REAL(name, int, const char *, int, ...); \
        va_list more; \
        va_start(more, flags); \
        mode_t rights = (flags & O_CREAT) ? va_arg(more, mode_t) : 0; \
        va_end(more); \
        return opens(path, flags) ? -1 : real(path, flags, rights); \
    }
OPEN(open)
OPEN(open64)
