/* Damages a body again and again, opens it, and moves what opens: for the sanitizers, which end it at the first fault.
 *
 *     fuzz body.bin SEED TIMES
 */
#include <stdio.h>
#include <stdlib.h>

#include "truespring.h"

static uint64_t seed = 1;

static uint32_t any(uint32_t below)
{
    seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(seed >> 33) % below;
}

/* Damage a copy of the data; return its length. */
static size_t damaged(unsigned char *copy, size_t bytes)
{
    static const uint32_t odd[] = {0, 1, 2, 3, 7, 8, 255, 65536, 0x7fffffff, 0x80000000u, 0xffffffffu, 0x7ff00000};
    uint32_t k, times = 1 + any(4);
    for (k = 0; k < times; k++) {
        /* the counts stand at the begin: damage them often */
        size_t at = any(3) ? any((uint32_t)(bytes < 400 ? bytes : 400)) : any((uint32_t)bytes);
        uint32_t value = any(2) ? odd[any(12)] : any(0x7fffffff);
        switch (any(4)) {
        case 0: copy[at] = (unsigned char)any(256); break;
        case 1: bytes = at < 1 ? 1 : at; break;
        default:
            at -= at % 4;
            if (at + 4 <= bytes) memcpy(copy + at, &value, 4);
        }
        if (bytes < 8) break;
    }
    if (bytes >= 32 && any(10)) { /* make length and checksum right, so that the content is read */
        uint64_t length = bytes, sum = truespring_checksum(copy + 32, bytes - 32);
        uint32_t marks[2] = {0x01020304, TRUESPRING_VERSION};
        memcpy(copy, "TRSPRING", 8);
        memcpy(copy + 8, marks, 8);
        memcpy(copy + 16, &length, 8);
        memcpy(copy + 24, &sum, 8);
    }
    return bytes;
}

static void move(truespring_body *body)
{
    truespring_real place[3] = {0.01f, 0.02f, 0.03f};
    truespring_real *force = (truespring_real *)malloc(3 * (size_t)body->n_nodes * sizeof *force);
    int k;
    (void)truespring_start(body);
    (void)truespring_pull(body, (int)any(10) - 1, place, any(2) ? place : NULL, any(2) ? body->patch : 0, 0);
    (void)truespring_pull(body, TRUESPRING_GRIPS - 1, place, place, 1, 1);
    (void)truespring_sphere(body, (int)any(10) - 1, place, place[0], 0);
    for (k = 0; k < 3; k++) (void)truespring_step(body, body->step);
    (void)truespring_step_euler(body, body->step);
    (void)truespring_advance(body, body->step * 2);
    (void)truespring_force(body, force);
    (void)truespring_energy(body);
    (void)truespring_kinetic_energy(body);
    truespring_release(body, 0);
    (void)truespring_settle(body, (truespring_real)1e-6, 3);
    free(force);
}

int main(int n, char **arguments)
{
    static unsigned char data[1 << 20];
    size_t bytes;
    int k, times = n > 3 ? atoi(arguments[3]) : 0, opened = 0, codes[64] = {0};
    FILE *file = n > 1 ? fopen(arguments[1], "rb") : NULL;
    if (!file || !times) return 2;
    bytes = fread(data, 1, sizeof data, file);
    fclose(file);
    seed = strtoul(arguments[2], NULL, 10);
    for (k = 0; k < times; k++) {
        unsigned char *copy = (unsigned char *)malloc(bytes), *exact;
        void *memory;
        truespring_body body;
        size_t size, length;
        int error;
        memcpy(copy, data, bytes);
        length = damaged(copy, bytes);
        exact = (unsigned char *)malloc(length); /* so that reading beyond the end is seen */
        memcpy(exact, copy, length);
        free(copy);
        size = truespring_memory(exact, length);
        memory = malloc(size ? size : 1);
        error = truespring_open(&body, memory, size, exact, length);
        free(exact);
        if ((!error && !size) || error > 0 || error < -63 || !*truespring_error_text(error)) return 3;
        codes[-error]++;
        if (!error) {
            opened++;
            move(&body);
        }
        free(memory);
    }
    printf("%d opened", opened);
    for (k = 1; k < 64; k++)
        if (codes[k]) printf(", %d of %d", codes[k], -k);
    printf("\n");
    return 0;
}
