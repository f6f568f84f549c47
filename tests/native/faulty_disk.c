/* A disk that fails at the N-th change: preloaded into a program, it counts what the program does to the files of one
 * folder and then, once, kills the program, tears a write in two and kills it, or refuses with an error.
 *
 * FAULTY_FOLDER   the folder, absolute
 * FAULTY_AT       the change at which to fail, from 1; 0 only counts
 * FAULTY_HOW      kill, tear, or the number of an error (5 EIO, 28 ENOSPC)
 * FAULTY_COUNT    a file to which the number of changes is written at the end
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

static long changes;

static int is_ours(const char *path) {
    const char *folder = getenv("FAULTY_FOLDER");
    return folder != NULL && strncmp(path, folder, strlen(folder)) == 0;
}

static int is_our_file(int file) {
    char link[64], path[PATH_MAX];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return is_ours(path);
}

/* What to do with this change: 0 let it be, 1 tear it, else refuse it with errno set. */
static int fate(void) {
    const char *at = getenv("FAULTY_AT"), *how = getenv("FAULTY_HOW");
    if (++changes != (at ? atol(at) : 0) || how == NULL) return 0;
    if (strcmp(how, "tear") == 0) return 1;
    if (strcmp(how, "kill") == 0) kill(getpid(), SIGKILL);
    errno = atoi(how);
    return -1;
}

static void die(void) { kill(getpid(), SIGKILL); }

__attribute__((destructor)) static void tell(void) {
    const char *path = getenv("FAULTY_COUNT");
    FILE *file = path ? fopen(path, "w") : NULL;
    if (file) {
        fprintf(file, "%ld\n", changes);
        fclose(file);
    }
}

#define REAL(type, name, ...) \
    static type (*real)(__VA_ARGS__); \
    if (!real) real = (type(*)(__VA_ARGS__))dlsym(RTLD_NEXT, name)

#define WRITE_AT(name, offset_type) \
    ssize_t name(int file, const void *bytes, size_t size, offset_type offset) { \
        REAL(ssize_t, #name, int, const void *, size_t, offset_type); \
        int what = is_our_file(file) ? fate() : 0; \
        if (what < 0) return -1; \
        if (what) { real(file, bytes, size / 2, offset); die(); } \
        return real(file, bytes, size, offset); \
    }

WRITE_AT(pwrite, off_t)
WRITE_AT(pwrite64, off64_t)

ssize_t write(int file, const void *bytes, size_t size) {
    REAL(ssize_t, "write", int, const void *, size_t);
    int what = is_our_file(file) ? fate() : 0;
    if (what < 0) return -1;
    if (what) { real(file, bytes, size / 2); die(); }
    return real(file, bytes, size);
}

#define ON_FILE(name) \
    int name(int file) { \
        REAL(int, #name, int); \
        int what = is_our_file(file) ? fate() : 0; \
        if (what > 0) die(); \
        return what ? -1 : real(file); \
    }

ON_FILE(fsync)
ON_FILE(fdatasync)

#define RESIZE(name, offset_type) \
    int name(int file, offset_type size) { \
        REAL(int, #name, int, offset_type); \
        int what = is_our_file(file) ? fate() : 0; \
        if (what > 0) die(); \
        return what ? -1 : real(file, size); \
    }

RESIZE(ftruncate, off_t)
RESIZE(ftruncate64, off64_t)

int unlink(const char *path) {
    REAL(int, "unlink", const char *);
    int what = is_ours(path) ? fate() : 0;
    if (what > 0) die();
    return what ? -1 : real(path);
}

#define TWO_NAMES(name) \
    int name(const char *from, const char *to) { \
        REAL(int, #name, const char *, const char *); \
        int what = is_ours(to) ? fate() : 0; \
        if (what > 0) die(); \
        return what ? -1 : real(from, to); \
    }

TWO_NAMES(rename)
TWO_NAMES(link)
