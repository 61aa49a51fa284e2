/* Copyright 2026 the mtpgo_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Sets the machine's clock for the processes that load this by LD_PRELOAD, and for no others: their
 * CLOCK_REALTIME is the kernel's plus the offset (int64, ns) in the file MTPGO_TEST_CLOCK. What
 * waits until a time of that clock waits for that time, as in the kernel when the clock is set
 * back; when it is set forward, a wait that goes on ends where it would have ended before.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <semaphore.h>
#include <errno.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#define S_NS 1000000000LL

static const int64_t none;
static const volatile int64_t *offset_ns = &none;

static int (*cond_timedwait)(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);
static int (*mutex_timedlock)(pthread_mutex_t *, const struct timespec *);
static int (*semaphore_timedwait)(sem_t *, const struct timespec *);

__attribute__((constructor)) static void open_clock(void)
{
    /* The first version of the function, which dlsym may return, has other conditions. */
    cond_timedwait = dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");
    if (!cond_timedwait)
        cond_timedwait = dlsym(RTLD_NEXT, "pthread_cond_timedwait");
    mutex_timedlock = dlsym(RTLD_NEXT, "pthread_mutex_timedlock");
    semaphore_timedwait = dlsym(RTLD_NEXT, "sem_timedwait");
    const char *path = getenv("MTPGO_TEST_CLOCK");
    int file = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;
    if (file < 0)
        return;
    void *mapped = mmap(0, sizeof(int64_t), PROT_READ, MAP_SHARED, file, 0);
    close(file);
    if (mapped != MAP_FAILED)
        offset_ns = mapped;
}

static int64_t to_ns(const struct timespec *time)
{
    return time->tv_sec * S_NS + time->tv_nsec;
}

static struct timespec of_ns(int64_t ns)
{
    struct timespec time = {ns / S_NS, ns % S_NS};
    if (time.tv_nsec < 0) {
        time.tv_nsec += S_NS;
        time.tv_sec -= 1;
    }
    return time;
}

int clock_gettime(clockid_t clock, struct timespec *time)
{
    int error = syscall(SYS_clock_gettime, clock, time);
    if (!error && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE))
        *time = of_ns(to_ns(time) + *offset_ns);
    return error;
}

int gettimeofday(struct timeval *restrict time, void *restrict zone)
{
    struct timespec now;
    (void)zone;
    clock_gettime(CLOCK_REALTIME, &now);
    time->tv_sec = now.tv_sec;
    time->tv_usec = now.tv_nsec / 1000;
    return 0;
}

time_t time(time_t *result)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (result)
        *result = now.tv_sec;
    return now.tv_sec;
}

/* Whether a wait until `until` that has timed out goes on: the clock was set back meanwhile. */
static int goes_on(const struct timespec *until)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    return to_ns(&now) < to_ns(until);
}

int pthread_cond_timedwait(
    pthread_cond_t *condition, pthread_mutex_t *mutex, const struct timespec *until)
{
    /* As __condvar_get_clock in glibc: the second bit says that the clock is the monotonic one. */
    if (condition->__data.__wrefs & 2)
        return cond_timedwait(condition, mutex, until);
    int error;
    do {
        struct timespec kernel = of_ns(to_ns(until) - *offset_ns);
        error = cond_timedwait(condition, mutex, &kernel);
    } while (error == ETIMEDOUT && goes_on(until));
    return error;
}

int pthread_mutex_timedlock(pthread_mutex_t *mutex, const struct timespec *until)
{
    int error;
    do {
        struct timespec kernel = of_ns(to_ns(until) - *offset_ns);
        error = mutex_timedlock(mutex, &kernel);
    } while (error == ETIMEDOUT && goes_on(until));
    return error;
}

int sem_timedwait(sem_t *semaphore, const struct timespec *until)
{
    int error;
    do {
        struct timespec kernel = of_ns(to_ns(until) - *offset_ns);
        error = semaphore_timedwait(semaphore, &kernel);
    } while (error && errno == ETIMEDOUT && goes_on(until));
    return error;
}
