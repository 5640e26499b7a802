/* The file calls of a process and of all it starts: counted, written down, or failed on purpose.

Preloaded by tests/campaigns/file_calls.py, which has the other half of what is laid out here.

    FILE_CALLS_UNDER   folders, ':' between them; calls elsewhere are none of our business
    FILE_CALLS_SHARED  a file of struct shared: what is counted, and which call is to fail
    FILE_CALLS_LOG     a file to which each call is appended that has changed something there

A call to the C library is what is seen; calls that the library or the loader make themselves are
not. */

#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

enum kind { OPEN, READ, WRITE, SYNC, RENAME, MAP, UNLINK, FOLDER, TRUNCATE, LOOK, LINK, ANY, KINDS };

#define SHORT (-1) /* in place of an error: half of what was asked for */

struct shared {
    _Atomic uint64_t seen[KINDS];
    _Atomic uint64_t failed;
    int64_t kind, at, error, for_good;
    char where[PATH_MAX];
};

static struct shared *shared;
static int log_to = -1;
static char folders[16][PATH_MAX];
static int folder_count;
static pthread_once_t once = PTHREAD_ONCE_INIT;
static pthread_mutex_t in_order = PTHREAD_MUTEX_INITIALIZER;

static void begin(void)
{
    const char *under = getenv("FILE_CALLS_UNDER");
    const char *counts = getenv("FILE_CALLS_SHARED"), *log = getenv("FILE_CALLS_LOG");
    while (under && *under && folder_count < 16) {
        size_t length = strcspn(under, ":");
        if (length && length < PATH_MAX)
            memcpy(folders[folder_count++], under, length);
        under += length + (under[length] == ':');
    }
    if (counts) {
        int fd = (int)syscall(SYS_openat, AT_FDCWD, counts, O_RDWR | O_CLOEXEC, 0);
        if (fd >= 0) {
            void *at = (void *)syscall(SYS_mmap, 0, sizeof *shared, PROT_READ | PROT_WRITE,
                                       MAP_SHARED, fd, 0);
            shared = at == MAP_FAILED ? NULL : at;
            syscall(SYS_close, fd);
        }
    }
    if (log) {
        int fd = (int)syscall(SYS_openat, AT_FDCWD, log, O_WRONLY | O_APPEND | O_CLOEXEC, 0);
        /* Out of the way of programs that close the low ones. */
        log_to = fd < 0 ? -1 : (int)syscall(SYS_fcntl, fd, F_DUPFD_CLOEXEC, 900);
        if (fd >= 0)
            syscall(SYS_close, fd);
    }
}

static int is_ours(const char *path)
{
    for (int i = 0; i < folder_count; i++) {
        size_t length = strlen(folders[i]);
        if (!strncmp(path, folders[i], length) && (!path[length] || path[length] == '/'))
            return 1;
    }
    return 0;
}

static int of_fd(int fd, char *path)
{
    char link[48];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    long length = syscall(SYS_readlinkat, AT_FDCWD, link, path, PATH_MAX - 1);
    path[length > 0 ? length : 0] = 0;
    return length > 0;
}

/* Make a path absolute; tell whether it is ours. */
static int of_name(int folder, const char *name, char *path)
{
    pthread_once(&once, begin);
    if (!folder_count || !name)
        return 0;
    if (name[0] == '/') {
        snprintf(path, PATH_MAX, "%s", name);
    } else if (folder == AT_FDCWD) {
        char here[PATH_MAX];
        if (syscall(SYS_getcwd, here, sizeof here) < 0)
            return 0;
        snprintf(path, PATH_MAX, "%.*s/%.*s", PATH_MAX / 2, here, PATH_MAX / 2 - 2, name);
    } else {
        char there[PATH_MAX];
        if (!of_fd(folder, there))
            return 0;
        snprintf(path, PATH_MAX, "%.*s/%.*s", PATH_MAX / 2, there, PATH_MAX / 2 - 2, name);
    }
    return is_ours(path);
}

static int of_open(int fd, char *path)
{
    pthread_once(&once, begin);
    return folder_count && fd != log_to && of_fd(fd, path) && is_ours(path);
}

/* Count a call on a path of ours; return 0, an error, or SHORT. */
static int64_t fate(enum kind kind, const char *path)
{
    if (!shared)
        return 0;
    uint64_t number = atomic_fetch_add(&shared->seen[kind], 1) + 1;
    uint64_t in_all = atomic_fetch_add(&shared->seen[ANY], 1) + 1;
    if (shared->kind == ANY)
        number = in_all;
    else if (shared->kind != kind)
        return 0;
    if (!shared->at || number < (uint64_t)shared->at ||
        (number > (uint64_t)shared->at && !shared->for_good))
        return 0;
    if (!atomic_fetch_add(&shared->failed, 1))
        snprintf(shared->where, PATH_MAX, "%s", path);
    return shared->error;
}

struct entry {
    uint32_t bytes, kind;
    int32_t process;
    uint32_t flags;
    uint64_t file;
    int64_t offset, time_ns;
    uint32_t path, second;
    uint64_t data;
};

/* Write a call down; the lock keeps the calls of a process in their order. */
static void note(enum kind kind, uint64_t file, int64_t offset, uint32_t flags, const char *path,
                 const char *second, const void *data, size_t length)
{
    if (log_to < 0)
        return;
    struct entry entry = {.kind = kind, .process = getpid(), .flags = flags, .file = file};
    entry.offset = offset;
    entry.path = (uint32_t)strlen(path);
    entry.second = second ? (uint32_t)strlen(second) : 0;
    entry.data = length;
    entry.bytes = sizeof entry;
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    entry.time_ns = now.tv_sec * 1000000000LL + now.tv_nsec;
    struct iovec parts[] = {{&entry, sizeof entry},
                            {(void *)path, entry.path},
                            {(void *)second, entry.second},
                            {(void *)data, length}};
    int kept = errno;
    syscall(SYS_writev, log_to, parts, 4);
    errno = kept;
}

static uint64_t file_of(int fd)
{
    struct stat about;
    return syscall(SYS_newfstatat, fd, "", &about, AT_EMPTY_PATH) ? 0 : about.st_ino;
}

static int is_there(int folder, const char *name)
{
    struct stat about;
    return !syscall(SYS_newfstatat, folder, name, &about, 0);
}

#define REAL(name) \
    static __typeof__(name) *real; \
    if (!real) \
        real = (__typeof__(name) *)dlsym(RTLD_NEXT, #name)

#define FAIL_IF(ours, kind, failure) \
    int64_t sad = (ours) ? fate(kind, path) : 0; \
    if (sad > 0) { \
        errno = (int)sad; \
        return failure; \
    }

#define LOCKED(ours) \
    if (ours && log_to >= 0) \
        pthread_mutex_lock(&in_order)
#define UNLOCKED(ours) \
    if (ours && log_to >= 0) \
        pthread_mutex_unlock(&in_order)

/* ---- names ---- */

enum { MADE = 1, EMPTIED = 2 };

static int open_and_note(int (*real)(int, const char *, int, ...), int folder, const char *name,
                         int flags, mode_t mode)
{
    char path[PATH_MAX];
    int ours = of_name(folder, name, path);
    FAIL_IF(ours, OPEN, -1)
    LOCKED(ours);
    int was_there = ours && is_there(folder, name);
    int fd = real(folder, name, flags, mode);
    if (ours && fd >= 0 && (flags & O_ACCMODE) != O_RDONLY) {
        uint32_t what = (was_there ? 0 : MADE) | (flags & O_TRUNC ? EMPTIED : 0);
        if (what)
            note(OPEN, file_of(fd), 0, what, path, NULL, NULL, 0);
    } else if (ours && fd >= 0 && !was_there && (flags & O_CREAT)) {
        note(OPEN, file_of(fd), 0, MADE, path, NULL, NULL, 0);
    }
    UNLOCKED(ours);
    return fd;
}

static mode_t mode_of(int flags, va_list words)
{
    return flags & (O_CREAT | O_TMPFILE) ? va_arg(words, mode_t) : 0;
}

#define OPENS(name) \
    int name(const char *file, int flags, ...) \
    { \
        REAL(openat); \
        va_list words; \
        va_start(words, flags); \
        mode_t mode = mode_of(flags, words); \
        va_end(words); \
        return open_and_note(real, AT_FDCWD, file, flags, mode); \
    }
OPENS(open)
OPENS(open64)

#define OPENS_AT(name) \
    int name(int folder, const char *file, int flags, ...) \
    { \
        REAL(name); \
        va_list words; \
        va_start(words, flags); \
        mode_t mode = mode_of(flags, words); \
        va_end(words); \
        return open_and_note(real, folder, file, flags, mode); \
    }
OPENS_AT(openat)
OPENS_AT(openat64)

int creat(const char *file, mode_t mode)
{
    return open(file, O_CREAT | O_WRONLY | O_TRUNC, mode);
}

#define OPENS_STREAM(name) \
    FILE *name(const char *restrict file, const char *restrict how) \
    { \
        REAL(name); \
        char path[PATH_MAX]; \
        FAIL_IF(of_name(AT_FDCWD, file, path), OPEN, NULL) \
        return real(file, how); \
    }
OPENS_STREAM(fopen)
OPENS_STREAM(fopen64)

DIR *opendir(const char *name)
{
    REAL(opendir);
    char path[PATH_MAX];
    FAIL_IF(of_name(AT_FDCWD, name, path), OPEN, NULL)
    return real(name);
}

static int move(int (*real)(int, const char *, int, const char *, unsigned), int folder,
                const char *name, int folder2, const char *name2, unsigned flags)
{
    char path[PATH_MAX], path2[PATH_MAX];
    int ours = of_name(folder, name, path) | of_name(folder2, name2, path2);
    FAIL_IF(ours, RENAME, -1)
    LOCKED(ours);
    int failed = real(folder, name, folder2, name2, flags);
    if (ours && !failed)
        note(RENAME, 0, 0, 0, path, path2, NULL, 0);
    UNLOCKED(ours);
    return failed;
}

int renameat2(int folder, const char *name, int folder2, const char *name2, unsigned flags)
{
    REAL(renameat2);
    return move(real, folder, name, folder2, name2, flags);
}

int renameat(int folder, const char *name, int folder2, const char *name2)
{
    REAL(renameat2);
    return move(real, folder, name, folder2, name2, 0);
}

int rename(const char *name, const char *name2)
{
    REAL(renameat2);
    return move(real, AT_FDCWD, name, AT_FDCWD, name2, 0);
}

int unlinkat(int folder, const char *name, int flags)
{
    REAL(unlinkat);
    char path[PATH_MAX];
    int ours = of_name(folder, name, path);
    FAIL_IF(ours, UNLINK, -1)
    LOCKED(ours);
    int failed = real(folder, name, flags);
    if (ours && !failed)
        note(UNLINK, 0, 0, 0, path, NULL, NULL, 0);
    UNLOCKED(ours);
    return failed;
}

int unlink(const char *name)
{
    return unlinkat(AT_FDCWD, name, 0);
}

int rmdir(const char *name)
{
    return unlinkat(AT_FDCWD, name, AT_REMOVEDIR);
}

int remove(const char *name)
{
    return unlinkat(AT_FDCWD, name, 0) && errno == EISDIR ? rmdir(name) : 0;
}

int mkdirat(int folder, const char *name, mode_t mode)
{
    REAL(mkdirat);
    char path[PATH_MAX];
    int ours = of_name(folder, name, path);
    FAIL_IF(ours, FOLDER, -1)
    LOCKED(ours);
    int failed = real(folder, name, mode);
    if (ours && !failed)
        note(FOLDER, 0, 0, 0, path, NULL, NULL, 0);
    UNLOCKED(ours);
    return failed;
}

int mkdir(const char *name, mode_t mode)
{
    return mkdirat(AT_FDCWD, name, mode);
}

int symlinkat(const char *target, int folder, const char *name)
{
    REAL(symlinkat);
    char path[PATH_MAX];
    int ours = of_name(folder, name, path);
    FAIL_IF(ours, LINK, -1)
    LOCKED(ours);
    int failed = real(target, folder, name);
    if (ours && !failed)
        note(LINK, 0, 0, 0, path, target, NULL, 0);
    UNLOCKED(ours);
    return failed;
}

int symlink(const char *target, const char *name)
{
    return symlinkat(target, AT_FDCWD, name);
}

#define LOOKS(name) \
    int name(const char *restrict file, struct name##_about *restrict about) \
    { \
        REAL(name); \
        char path[PATH_MAX]; \
        FAIL_IF(of_name(AT_FDCWD, file, path), LOOK, -1) \
        return real(file, about); \
    }
#define stat_about stat
#define lstat_about stat
LOOKS(stat)
LOOKS(lstat)
#undef stat_about
#define stat64_about stat64
#define lstat64_about stat64
LOOKS(stat64)
LOOKS(lstat64)

int access(const char *name, int how)
{
    REAL(access);
    char path[PATH_MAX];
    FAIL_IF(of_name(AT_FDCWD, name, path), LOOK, -1)
    return real(name, how);
}

/* ---- bytes ---- */

#define READS(name, declared, given, bytes, less) \
    ssize_t name declared \
    { \
        REAL(name); \
        char path[PATH_MAX]; \
        FAIL_IF(of_open(fd, path), READ, -1) \
        if (sad == SHORT && (bytes) > 1) \
            return real less; \
        return real given; \
    }
READS(read, (int fd, void *to, size_t n), (fd, to, n), n, (fd, to, n / 2))
READS(pread, (int fd, void *to, size_t n, off_t at), (fd, to, n, at), n, (fd, to, n / 2, at))
READS(pread64, (int fd, void *to, size_t n, off64_t at), (fd, to, n, at), n, (fd, to, n / 2, at))
READS(readv, (int fd, const struct iovec *to, int n), (fd, to, n), n, (fd, to, 1))

static ssize_t written(int ours, int fd, const char *path, int64_t at, const void *data, ssize_t n)
{
    if (ours && n > 0 && log_to >= 0) {
        if (at < 0)
            at = (int64_t)syscall(SYS_lseek, fd, 0, SEEK_CUR) - n;
        note(WRITE, file_of(fd), at, 0, path, NULL, data, (size_t)n);
    }
    return n;
}

ssize_t write(int fd, const void *data, size_t n)
{
    REAL(write);
    char path[PATH_MAX];
    int ours = of_open(fd, path);
    FAIL_IF(ours, WRITE, -1)
    LOCKED(ours);
    ssize_t done = real(fd, data, sad == SHORT && n > 1 ? n / 2 : n);
    written(ours, fd, path, -1, data, done);
    UNLOCKED(ours);
    return done;
}

#define WRITES_AT(name, type) \
    ssize_t name(int fd, const void *data, size_t n, type at) \
    { \
        REAL(name); \
        char path[PATH_MAX]; \
        int ours = of_open(fd, path); \
        FAIL_IF(ours, WRITE, -1) \
        LOCKED(ours); \
        ssize_t done = real(fd, data, sad == SHORT && n > 1 ? n / 2 : n, at); \
        written(ours, fd, path, at, data, done); \
        UNLOCKED(ours); \
        return done; \
    }
WRITES_AT(pwrite, off_t)
WRITES_AT(pwrite64, off64_t)

ssize_t writev(int fd, const struct iovec *parts, int count)
{
    REAL(writev);
    char path[PATH_MAX];
    int ours = of_open(fd, path);
    if (!ours)
        return real(fd, parts, count);
    /* One part is a short write, too: whoever writes parts goes on with the next. */
    for (int i = 0; i < count; i++)
        if (parts[i].iov_len)
            return write(fd, parts[i].iov_base, parts[i].iov_len);
    return 0;
}

ssize_t copy_file_range(int from, off64_t *at, int to, off64_t *at2, size_t n, unsigned flags)
{
    REAL(copy_file_range);
    char path[PATH_MAX];
    if (of_open(to, path) || of_open(from, path)) {
        errno = EXDEV; /* as between file systems: the bytes are read and written then */
        return -1;
    }
    return real(from, at, to, at2, n, flags);
}

ssize_t sendfile64(int to, int from, off64_t *at, size_t n)
{
    static ssize_t (*real)(int, int, off64_t *, size_t);
    if (!real)
        real = (ssize_t(*)(int, int, off64_t *, size_t))dlsym(RTLD_NEXT, "sendfile64");
    char path[PATH_MAX];
    if (of_open(to, path) || of_open(from, path)) {
        errno = EINVAL;
        return -1;
    }
    return real(to, from, at, n);
}

ssize_t sendfile(int to, int from, off_t *at, size_t n)
{
    return sendfile64(to, from, at, n);
}

#define SYNCS(name) \
    int name(int fd) \
    { \
        REAL(name); \
        char path[PATH_MAX]; \
        int ours = of_open(fd, path); \
        FAIL_IF(ours, SYNC, -1) \
        LOCKED(ours); \
        int failed = real(fd); \
        if (ours && !failed) \
            note(SYNC, file_of(fd), 0, 0, path, NULL, NULL, 0); \
        UNLOCKED(ours); \
        return failed; \
    }
SYNCS(fsync)
SYNCS(fdatasync)

enum { EVERYTHING = 4 };

int syncfs(int fd)
{
    REAL(syncfs);
    char path[PATH_MAX];
    int ours = of_open(fd, path);
    FAIL_IF(ours, SYNC, -1)
    int failed = real(fd);
    if (ours && !failed)
        note(SYNC, 0, 0, EVERYTHING, path, NULL, NULL, 0);
    return failed;
}

void sync(void)
{
    REAL(sync);
    pthread_once(&once, begin);
    real();
    if (folder_count)
        note(SYNC, 0, 0, EVERYTHING, "/", NULL, NULL, 0);
}

static int cut(int fd, off64_t length, int ours, const char *path)
{
    LOCKED(ours);
    int failed = (int)syscall(SYS_ftruncate, fd, length);
    if (failed)
        failed = -1;
    else if (ours)
        note(TRUNCATE, file_of(fd), length, 0, path, NULL, NULL, 0);
    UNLOCKED(ours);
    return failed;
}

#define CUTS(name, type) \
    int name(int fd, type length) \
    { \
        char path[PATH_MAX]; \
        int ours = of_open(fd, path); \
        FAIL_IF(ours, TRUNCATE, -1) \
        return cut(fd, length, ours, path); \
    }
CUTS(ftruncate, off_t)
CUTS(ftruncate64, off64_t)

#define CUTS_NAMED(name, type) \
    int name(const char *file, type length) \
    { \
        char path[PATH_MAX]; \
        int ours = of_name(AT_FDCWD, file, path); \
        FAIL_IF(ours, TRUNCATE, -1) \
        int fd = (int)syscall(SYS_openat, AT_FDCWD, file, O_WRONLY | O_CLOEXEC, 0); \
        if (fd < 0) \
            return -1; \
        int failed = cut(fd, length, ours, path); \
        int kept = errno; \
        syscall(SYS_close, fd); \
        errno = kept; \
        return failed; \
    }
CUTS_NAMED(truncate, off_t)
CUTS_NAMED(truncate64, off64_t)

#define MAPS(name, type) \
    void *name(void *at, size_t n, int how, int flags, int fd, type offset) \
    { \
        char path[PATH_MAX]; \
        FAIL_IF(fd >= 0 && of_open(fd, path), MAP, MAP_FAILED) \
        long done = syscall(SYS_mmap, at, n, how, flags, fd, offset); \
        return (void *)done; \
    }
MAPS(mmap, off_t)
MAPS(mmap64, off64_t)
