/* Sends a radar's beams as beam-udp (../beam-udp.md), format 2. cc -O2 -o sender sender.c && ./sender 127.0.0.1 6320
 * Put your radar in place of measure(). For a little-endian machine: the fields go out as they lie in memory. */
#define _DEFAULT_SOURCE
#include <arpa/inet.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { BEAMS = 220, HEADER = 48, RETURNS_MAX = 337 };
struct found { uint16_t bin; int16_t power_01db; };

static uint32_t crc32c(const uint8_t *bytes, size_t count) {
    uint32_t crc = ~0u;
    while (count--) {
        crc ^= *bytes++;
        for (int bit = 0; bit < 8; bit++) crc = (crc >> 1) ^ (0x82f63b78u & -(crc & 1));
    }
    return ~crc;
}

/* A wall at 4.83 m all around, in place of a radar. Blocks until the beam is measured; gives the number of returns. */
static uint16_t measure(uint16_t beam, struct found *found) {
    (void)beam;
    usleep(200000 / BEAMS);
    found[0] = (struct found){300, 250};
    return 1;
}

static size_t write_datagram(uint8_t *to, uint32_t sweep, uint16_t beam, const struct found *found, uint16_t count) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    uint64_t device_ns = (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
    uint32_t device = 1, azimuth = (uint32_t)(((uint64_t)beam << 32) / BEAMS), resolution_um = 16100;
    uint16_t header = HEADER, beams = BEAMS;
    memset(to, 0, HEADER); /* first bin, flags and offset stay 0 */
    memcpy(to, "RBM1\x01\x02", 6);
    memcpy(to + 6, &header, 2);
    memcpy(to + 8, &device, 4);
    memcpy(to + 12, &sweep, 4);
    memcpy(to + 16, &beam, 2);
    memcpy(to + 18, &beams, 2);
    to[21] = 1; /* fragments */
    memcpy(to + 22, &count, 2);
    memcpy(to + 28, &azimuth, 4);
    memcpy(to + 32, &device_ns, 8);
    memcpy(to + 40, &resolution_um, 4);
    memcpy(to + HEADER, found, count * sizeof *found);
    size_t length = HEADER + count * sizeof *found;
    uint32_t crc = crc32c(to, length);
    memcpy(to + length, &crc, 4);
    return length + 4;
}

int main(int arguments, char **argument) {
    if (arguments < 3) return 64;
    uint32_t sweeps = arguments > 3 ? (uint32_t)atoi(argument[3]) : UINT32_MAX;
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons((uint16_t)atoi(argument[2]))};
    int out = socket(AF_INET, SOCK_DGRAM, 0);
    if (out < 0 || inet_pton(AF_INET, argument[1], &to.sin_addr) != 1) return 1;
    for (uint32_t sweep = 0; sweep < sweeps; sweep++)
        for (uint16_t beam = 0; beam < BEAMS; beam++) {
            struct found found[RETURNS_MAX];
            uint8_t datagram[1400];
            uint16_t count = measure(beam, found);
            size_t length = write_datagram(datagram, sweep, beam, found, count);
            sendto(out, datagram, length, 0, (struct sockaddr *)&to, sizeof to);
        }
    return 0;
}
