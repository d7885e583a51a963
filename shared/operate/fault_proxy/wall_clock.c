/* Steps the wall clock of one process, for `roco fault clock`: loaded by LD_PRELOAD, it adds the nanoseconds that stand
 * in the mapped file ROCO_WALL_CLOCK to what the C library says of CLOCK_REALTIME. Other clocks, and all waits, which
 * go by the monotonic one, are left as they are. libfaketime does the same and more, but its version 0.9.10 either
 * shifts the monotonic clock, too, or lets clock_nanosleep fail with EINVAL, which is Python's time.sleep since 3.11.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static const volatile int64_t *offset_ns;
static int (*clock_gettime_of_libc)(clockid_t, struct timespec *);

__attribute__((constructor)) static void begin(void) {
    clock_gettime_of_libc = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    const char *name = getenv("ROCO_WALL_CLOCK");
    int file = name ? open(name, O_RDONLY | O_CLOEXEC) : -1;
    if (file < 0)
        return;
    void *page = mmap(NULL, sizeof(int64_t), PROT_READ, MAP_SHARED, file, 0);
    close(file);
    if (page != MAP_FAILED)
        offset_ns = page;
}

int clock_gettime(clockid_t id, struct timespec *now) {
    if (!clock_gettime_of_libc) /* asked before the constructor */
        clock_gettime_of_libc = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    int failed = clock_gettime_of_libc(id, now);
    if (!failed && offset_ns && (id == CLOCK_REALTIME || id == CLOCK_REALTIME_COARSE)) {
        int64_t ns = now->tv_nsec + *offset_ns % 1000000000;
        int64_t more = ns < 0 ? -1 : ns / 1000000000;
        now->tv_sec += *offset_ns / 1000000000 + more;
        now->tv_nsec = ns - more * 1000000000;
    }
    return failed;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone) {
    struct timespec exact;
    (void)zone;
    int failed = clock_gettime(CLOCK_REALTIME, &exact);
    now->tv_sec = exact.tv_sec;
    now->tv_usec = exact.tv_nsec / 1000;
    return failed;
}

time_t time(time_t *there) {
    struct timespec exact;
    clock_gettime(CLOCK_REALTIME, &exact);
    if (there)
        *there = exact.tv_sec;
    return exact.tv_sec;
}
