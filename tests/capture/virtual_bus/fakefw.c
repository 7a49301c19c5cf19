/* A virtual IEEE 1394 bus, preloaded before libdc1394 (LD_PRELOAD): no hardware and no change of the library.
 *
 * It pretends that /dev/fw0 .. /dev/fwN-1 exist and answers the interface that Linux gives to programs
 * (linux/firewire-cdev.h) for one IIDC 1.31 camera per node, so that the library enumerates, configures and captures.
 *
 *   gcc -O1 -Wall -Werror -shared -fPIC fakefw.c -o fakefw.so -ldl -lpthread
 *   FAKEFW_NODES=2 FAKEFW_STATE=bus.bin LD_PRELOAD=./fakefw.so python capture.py
 *
 * FAKEFW_NODES      cameras on the bus, 1 if unset
 * FAKEFW_BANDWIDTH  units that all cameras share, 4915 if unset as on a real bus
 * FAKEFW_FORMATS    per camera, between commas: 0 gives 640x480, 1 gives 800x600; 0 if unset
 * FAKEFW_LEGACY     if set, the cameras do not know 1394b
 * FAKEFW_SKEW_US    per camera, between commas: microseconds by which its frames are late
 * FAKEFW_STATE      a file of struct state, then the scene's images: frame by frame, in each node by node.
 *                   Without images the cameras send four moving balls, with the frame's number in the first bytes.
 *
 * What a real bus does and this one does as well: a camera's clock is the bus clock, so frames bear the time at which
 * they were due, however late this computer was; frames without a buffer are lost; ISO_EN by broadcast starts all
 * cameras on one cycle; after unplugging, every call fails with ENODEV and polling says POLLHUP.
 */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/firewire-cdev.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define MAX_NODES 4
#define MAX_FDS 1024
#define MAX_QUEUED 1024
#define CSR 0xfffff0000000ULL
#define COMMANDS 0xf00000u /* base of the camera's registers, bytes from CSR */
#define ISO_EN 0x80000000u
#define NEXT(function) ((__typeof__(&function))dlsym(RTLD_NEXT, #function))

struct state { /* shared with the test; little endian words */
    uint32_t magic, n_frames, width, height;
    volatile uint32_t unplugged, silent, lose, reserved; /* bit k: node k; lose: that many frames of node 0 */
    volatile uint32_t sent[MAX_NODES], lost[MAX_NODES];
};
#define MAGIC 0x31535746u

struct node { uint32_t rom[64], regs[0x1000 / 4]; int ready; uint64_t start_ns; uint32_t epoch; } nodes_[MAX_NODES];
struct buffer { uint64_t data; uint32_t size; };
struct handle {
    int used, server, node, streaming, stop;
    uint64_t closure, resource;
    uint32_t units;
    struct buffer queue[MAX_QUEUED];
    unsigned head, tail;
    pthread_t thread;
} *handles[MAX_FDS];

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static struct state private_state, *state;
static const uint8_t *scene;
static uint32_t units_used;

static int number(const char *name, int otherwise) { const char *s = getenv(name); return s ? atoi(s) : otherwise; }
static int n_nodes(void) { int n = number("FAKEFW_NODES", 1); return n > MAX_NODES ? MAX_NODES : n; }

static int listed(const char *name, int index) /* the index-th number between commas, or 0 */
{
    const char *s = getenv(name);
    while (s && index-- > 0) { s = strchr(s, ','); if (s) s++; }
    return s ? atoi(s) : 0;
}

static uint64_t now_ns(clockid_t clock) { struct timespec t; clock_gettime(clock, &t); return t.tv_sec * 1000000000ULL + t.tv_nsec; }

static uint32_t cycle_timer(uint64_t us) { return (us / 1000000 % 128) << 25 | (us % 1000000 / 125) << 12 | (us % 125 * 3072 / 125); }

static void open_state(void)
{
    if (state) return;
    const char *path = getenv("FAKEFW_STATE");
    struct stat about;
    int fd = path ? NEXT(open)(path, O_RDWR) : -1;
    state = &private_state;
    if (fd < 0 || fstat(fd, &about)) return;
    void *all = NEXT(mmap)(NULL, about.st_size, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    NEXT(close)(fd);
    if (all == MAP_FAILED || ((struct state *)all)->magic != MAGIC) abort();
    state = all;
    if (state->n_frames) scene = (uint8_t *)all + sizeof *state;
}

static int is_unplugged(int node) { return state->unplugged >> node & 1; }

static int leaf(uint32_t *rom, int at, const char *text) /* a text in the configuration ROM */
{
    int n = (strlen(text) + 4) / 4;
    char padded[64] = {0};
    strncpy(padded, text, sizeof padded - 1);
    rom[at] = (n + 2) << 16; rom[at + 1] = rom[at + 2] = 0;
    for (int i = 0; i < n; i++) { uint32_t word; memcpy(&word, padded + 4 * i, 4); rom[at + 3 + i] = ntohl(word); }
    return at + 3 + n;
}

static void make_rom(uint32_t *r, int k)
{
    r[0] = 0x04040000; r[1] = 0x31333934; r[2] = 0xe064a000; r[3] = 0x00accef0; r[4] = 0x1000 + k; /* GUID */
    r[5] = 3 << 16; r[6] = 0x0300acce; r[7] = 0x0c0083c0; r[8] = 0xd1000000 | (10 - 8);     /* unit directory at 10 */
    r[10] = 3 << 16; r[11] = 0x1200a02d; r[12] = 0x13000102; r[13] = 0xd4000000 | (15 - 13); /* dependent one at 15 */
    r[15] = 4 << 16; r[16] = 0x40000000 | (COMMANDS / 4);
    int vendor = 21, model = leaf(r, vendor, "skelgen test");
    leaf(r, model, "virtual IIDC");
    r[17] = 0x81000000 | (vendor - 17); r[18] = 0x82000000 | (model - 18);
    r[19] = 0x38000010; /* IIDC 1.31 */
}

#define REG(address) g[(address) / 4]
static void make_registers(uint32_t *g, int format)
{
    REG(0x100) = ISO_EN >> format;                          /* formats */
    REG(0x180 + 4 * format) = format ? 0x20000000 : 0x04000000; /* 800x600 is mode 2, 640x480 mode 5; grey, 8 bits */
    REG(format ? 0x228 : 0x214) = 0x1e000000;               /* 15, 30, 60 and 120 frames a second */
    REG(0x400) = getenv("FAKEFW_LEGACY") ? 0 : 0x00800000;  /* knows 1394b */
    REG(0x404) = 1u << 31 | 1u << 24 | 1u << 23 | 1u << 19; /* brightness, shutter, gain, trigger */
    REG(0x500) = 0x8b0000ff; REG(0x51c) = 0x8b001fff; REG(0x520) = 0x8b0102ff; REG(0x530) = 0x9d01c000;
    REG(0x800) = 0x82000080; REG(0x81c) = 0x83000100; REG(0x820) = 0x82000020; REG(0x830) = 0x80000000;
    REG(0x600) = 4u << 29; REG(0x604) = (format ? 2u : 5u) << 29; REG(0x608) = (uint32_t)format << 29;
    REG(0x60c) = 2u << 24; REG(0x610) = 0x80000000;
}

static void prepare(int k)
{
    struct node *n = &nodes_[k];
    if (n->ready) return;
    n->ready = 1;
    make_rom(n->rom, k);
    make_registers(n->regs, listed("FAKEFW_FORMATS", k));
}

static uint64_t period_ns(struct node *n) { return (uint64_t)(1e9 / (1.875 * (1 << (n->regs[0x600 / 4] >> 29)))); }

static void write_register(int k, uint32_t address, uint32_t value, uint64_t now)
{
    struct node *n = &nodes_[k];
    if (address >= 0x800 && address < 0x900) value |= 0x80000000; /* a feature stays present */
    if (address == 0x614 && value & ISO_EN && !(n->regs[0x614 / 4] & ISO_EN)) { n->start_ns = now; n->epoch++; }
    n->regs[address / 4] = value;
}

static void draw_balls(uint8_t *image, int width, int node, uint32_t k)
{
    for (int ball = 0; ball < 4; ball++) {
        int cx = 80 + 120 * ball + (k * 3) % 60 + 10 * node, cy = 100 + 70 * ball;
        for (int y = -5; y <= 5; y++)
            for (int x = -5; x <= 5; x++)
                if (x * x + y * y <= 25) image[(cy + y) * width + cx + x] = 200;
    }
    memcpy(image, &k, sizeof k);
}

static void draw(const struct buffer *b, struct node *n, int node, uint32_t k)
{
    uint8_t *image = (uint8_t *)(uintptr_t)b->data;
    uint32_t size = state->width * state->height;
    if (scene && size <= b->size) { memcpy(image, scene + ((uint64_t)(k % state->n_frames) * n_nodes() + node) * size, size); return; }
    memset(image, 12, b->size);
    draw_balls(image, n->regs[0x608 / 4] ? 800 : 640, node, k);
}

static void deliver(struct handle *h, struct node *n, uint32_t k, uint64_t due_us)
{
    pthread_mutex_lock(&lock);
    int full = h->head == h->tail;
    struct buffer b = full ? (struct buffer){0} : h->queue[h->head++ % MAX_QUEUED];
    pthread_mutex_unlock(&lock);
    if (full) { state->lost[h->node]++; return; } /* no buffer: the frame is lost */
    draw(&b, n, h->node, k);
    struct { struct fw_cdev_event_iso_interrupt i; uint32_t headers[8]; } event;
    memset(&event, 0, sizeof event);
    uint32_t cycle = cycle_timer(due_us) >> 12 & 0xffff;
    event.i.closure = h->closure; event.i.type = FW_CDEV_EVENT_ISO_INTERRUPT; event.i.cycle = cycle;
    event.i.header_length = 8; event.i.header[0] = htonl(b.size << 16); event.i.header[1] = htonl(cycle);
    if (send(h->server, &event, sizeof event.i + 8, MSG_NOSIGNAL) >= 0) state->sent[h->node]++;
}

static void *stream(void *argument)
{
    struct handle *h = argument;
    struct node *n = &nodes_[h->node];
    uint32_t k = 0, epoch = 0;
    uint64_t late = 1000ULL * listed("FAKEFW_SKEW_US", h->node);
    while (!h->stop) {
        if (is_unplugged(h->node)) { shutdown(h->server, SHUT_RDWR); return NULL; }
        if (n->epoch != epoch) { epoch = n->epoch; k = 0; }
        uint64_t now = now_ns(CLOCK_MONOTONIC), due = n->start_ns + (k + 1) * period_ns(n) + late;
        int is_on = n->regs[0x614 / 4] & ISO_EN && epoch;
        uint64_t next = is_on && due < now + 1000000 ? due : now + 1000000; /* wake often enough to see a change */
        struct timespec t = {next / 1000000000ULL, next % 1000000000ULL};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
        if (!is_on || next != due || h->stop) continue;
        k++;
        if (state->silent >> h->node & 1) continue;
        if (h->node == 0 && state->lose) { state->lose--; state->lost[0]++; continue; }
        deliver(h, n, k, (now_ns(CLOCK_REALTIME) - (now_ns(CLOCK_MONOTONIC) - due)) / 1000);
    }
    return NULL;
}

static struct handle *handle_of(int fd) { return fd >= 0 && fd < MAX_FDS && handles[fd] && handles[fd]->used ? handles[fd] : NULL; }

static int open_node(int k)
{
    int pair[2];
    open_state();
    if (k >= n_nodes()) { errno = ENOENT; return -1; }
    if (is_unplugged(k)) { errno = ENODEV; return -1; }
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, pair)) return -1;
    if (pair[0] >= MAX_FDS) abort();
    prepare(k);
    struct handle *h = handles[pair[0]] ? handles[pair[0]] : (handles[pair[0]] = malloc(sizeof *h));
    memset(h, 0, sizeof *h);
    h->used = 1; h->server = pair[1]; h->node = k;
    return pair[0];
}

static void stop_stream(struct handle *h)
{
    if (!h->streaming) return;
    h->stop = 1;
    pthread_join(h->thread, NULL);
    h->streaming = 0;
}

int open(const char *path, int flags, ...)
{
    int k, end;
    mode_t mode = 0;
    if (flags & O_CREAT) { va_list rest; va_start(rest, flags); mode = va_arg(rest, mode_t); va_end(rest); }
    if (sscanf(path, "/dev/fw%d%n", &k, &end) == 1 && !path[end]) return open_node(k);
    return ((int (*)(const char *, int, ...))dlsym(RTLD_NEXT, "open"))(path, flags, mode);
}

int close(int fd)
{
    struct handle *h = handle_of(fd);
    if (h) { stop_stream(h); units_used -= h->units; h->used = 0; NEXT(close)(h->server); }
    return NEXT(close)(fd);
}

ssize_t read(int fd, void *to, size_t n)
{
    struct handle *h = handle_of(fd);
    if (h && is_unplugged(h->node)) { errno = ENODEV; return -1; }
    return NEXT(read)(fd, to, n);
}

void *mmap(void *at, size_t length, int protection, int flags, int fd, off_t offset)
{
    if (handle_of(fd)) return NEXT(mmap)(at, length, protection, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    return NEXT(mmap)(at, length, protection, flags, fd, offset);
}

static DIR *device_folder;
static int device_position;

DIR *opendir(const char *path)
{
    DIR *folder = NEXT(opendir)(path);
    if (!strcmp(path, "/dev")) { device_folder = folder; device_position = 0; }
    return folder;
}

struct dirent *readdir(DIR *folder)
{
    static struct dirent entry;
    if (folder != device_folder || device_position >= n_nodes()) return NEXT(readdir)(folder);
    memset(&entry, 0, sizeof entry);
    snprintf(entry.d_name, sizeof entry.d_name, "fw%d", device_position++);
    return &entry;
}

static int get_info(struct handle *h, struct fw_cdev_get_info *info)
{
    struct node *n = &nodes_[h->node];
    struct fw_cdev_event_bus_reset *reset = (void *)(uintptr_t)info->bus_reset;
    info->version = 5;
    if (info->rom)
        memcpy((void *)(uintptr_t)info->rom, n->rom, info->rom_length < sizeof n->rom ? info->rom_length : sizeof n->rom);
    info->rom_length = sizeof n->rom;
    if (reset) { memset(reset, 0, sizeof *reset); reset->type = FW_CDEV_EVENT_BUS_RESET; reset->generation = 1; reset->node_id = 0xffc0 + h->node; }
    return 0;
}

static int answer(struct handle *h, const void *event, size_t size) { return send(h->server, event, size, MSG_NOSIGNAL) < 0 ? -1 : 0; }

static int broadcast(struct handle *h, const struct fw_cdev_send_request *r)
{
    if (r->offset < CSR) { errno = EACCES; return -1; }
    uint64_t address = r->offset - CSR - COMMANDS, now = now_ns(CLOCK_MONOTONIC);
    for (int k = 0; k < n_nodes() && address < 0x1000; k++) {
        prepare(k);
        write_register(k, address, ntohl(*(uint32_t *)(uintptr_t)r->data), now);
    }
    struct fw_cdev_event_response e = {.closure = r->closure, .type = FW_CDEV_EVENT_RESPONSE};
    return answer(h, &e, sizeof e);
}

static int request(struct handle *h, const struct fw_cdev_send_request *r)
{
    struct { struct fw_cdev_event_response e; uint32_t words[128]; } u;
    struct node *n = &nodes_[h->node];
    const uint32_t *given = (void *)(uintptr_t)r->data;
    int is_read = r->tcode == 4 || r->tcode == 5; /* a quadlet or a block */
    memset(&u, 0, sizeof u);
    u.e.closure = r->closure; u.e.type = FW_CDEV_EVENT_RESPONSE;
    for (uint32_t i = 0; i < r->length / 4; i++) {
        uint64_t a = r->offset - CSR + 4 * i;
        int in_rom = a >= 0x400 && a < 0x500, in_commands = a >= COMMANDS && a < COMMANDS + 0x1000;
        if (!in_commands && !(in_rom && is_read)) u.e.rcode = 7; /* no such address */
        else if (is_read) u.e.data[i] = htonl(in_rom ? n->rom[(a - 0x400) / 4] : n->regs[(a - COMMANDS) / 4]);
        else write_register(h->node, a - COMMANDS, ntohl(given[i]), now_ns(CLOCK_MONOTONIC));
    }
    u.e.length = is_read && !u.e.rcode ? r->length : 0;
    return answer(h, &u, sizeof u.e + u.e.length);
}

static int allocate(struct handle *h, struct fw_cdev_allocate_iso_resource *r)
{
    int fits = units_used + r->bandwidth <= (uint32_t)number("FAKEFW_BANDWIDTH", 4915);
    struct fw_cdev_event_iso_resource e = {.closure = r->closure, .type = FW_CDEV_EVENT_ISO_RESOURCE_ALLOCATED, .handle = 1,
                                           .channel = r->channels && fits ? h->node : -EBUSY, .bandwidth = fits ? r->bandwidth : 0};
    r->handle = 1;
    h->resource = r->closure;
    if (fits) { h->units += r->bandwidth; units_used += r->bandwidth; }
    return answer(h, &e, sizeof e);
}

static int release(struct handle *h)
{
    struct fw_cdev_event_iso_resource e = {.closure = h->resource, .type = FW_CDEV_EVENT_ISO_RESOURCE_DEALLOCATED, .handle = 1};
    units_used -= h->units;
    h->units = 0;
    return answer(h, &e, sizeof e);
}

static int enqueue(struct handle *h, const struct fw_cdev_queue_iso *q)
{
    const struct fw_cdev_iso_packet *packets = (void *)(uintptr_t)q->packets;
    uint32_t size = 0;
    for (uint32_t i = 0; i < q->size / sizeof *packets; i++) size += packets[i].control & 0xffff;
    pthread_mutex_lock(&lock);
    h->queue[h->tail++ % MAX_QUEUED] = (struct buffer){q->data, size};
    pthread_mutex_unlock(&lock);
    return 0;
}

int ioctl(int fd, unsigned long what, ...)
{
    va_list rest;
    va_start(rest, what);
    void *with = va_arg(rest, void *);
    va_end(rest);
    struct handle *h = handle_of(fd);
    if (!h) return NEXT(ioctl)(fd, what, with);
    if (is_unplugged(h->node)) { errno = ENODEV; return -1; }
    switch (what) {
    case FW_CDEV_IOC_GET_INFO: return get_info(h, with);
    case FW_CDEV_IOC_SEND_BROADCAST_REQUEST: return broadcast(h, with);
    case FW_CDEV_IOC_SEND_REQUEST: return request(h, with);
    case FW_CDEV_IOC_ALLOCATE_ISO_RESOURCE: return allocate(h, with);
    case FW_CDEV_IOC_DEALLOCATE_ISO_RESOURCE: return release(h);
    case FW_CDEV_IOC_CREATE_ISO_CONTEXT: {
        struct fw_cdev_create_iso_context *c = with;
        h->closure = c->closure; c->handle = 0;
        return 0; }
    case FW_CDEV_IOC_QUEUE_ISO: return enqueue(h, with);
    case FW_CDEV_IOC_START_ISO:
        h->streaming = 1; h->stop = 0;
        return pthread_create(&h->thread, NULL, stream, h) ? -1 : 0;
    case FW_CDEV_IOC_STOP_ISO: stop_stream(h); return 0;
    case FW_CDEV_IOC_GET_CYCLE_TIMER: {
        struct fw_cdev_get_cycle_timer *t = with;
        t->local_time = now_ns(CLOCK_REALTIME) / 1000; t->cycle_timer = cycle_timer(t->local_time);
        return 0; }
    case FW_CDEV_IOC_INITIATE_BUS_RESET: return 0;
    }
    errno = EINVAL;
    return -1;
}
