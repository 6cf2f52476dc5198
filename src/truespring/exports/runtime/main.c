/* Settles the body of body.bin and prints the displacement of the probe beside the expected one.
 *
 *     cc -O2 -std=c99 main.c -o settle -lm && ./settle body.bin
 */
#include <stdio.h>
#include <stdlib.h>

#include "truespring.h"

/* Return the content of a file, NULL if it cannot be read. */
static unsigned char *content_of(const char *name, size_t *bytes)
{
    unsigned char *data = NULL;
    long end;
    FILE *file = fopen(name, "rb");
    if (!file) return NULL;
    if (fseek(file, 0, SEEK_END) == 0 && (end = ftell(file)) > 0 && fseek(file, 0, SEEK_SET) == 0) {
        data = (unsigned char *)malloc((size_t)end);
        if (data && fread(data, 1, (size_t)end, file) != (size_t)end) {
            free(data);
            data = NULL;
        }
        *bytes = (size_t)end;
    }
    fclose(file);
    return data;
}

static void print_displacement(const char *what, const truespring_body *body, const truespring_real *x)
{
    size_t i = 3 * (size_t)body->probe;
    printf("%s node %lu: %.9g %.9g %.9g m\n", what, (unsigned long)body->probe, (double)(x[i] - body->rest[i]),
           (double)(x[i + 1] - body->rest[i + 1]), (double)(x[i + 2] - body->rest[i + 2]));
}

int main(int n, char **arguments)
{
    truespring_body body;
    size_t bytes = 0, size;
    unsigned char *data = content_of(n > 1 ? arguments[1] : "body.bin", &bytes);
    void *memory;
    int done;
    if (!data) {
        fprintf(stderr, "cannot read %s\n", n > 1 ? arguments[1] : "body.bin");
        return 2;
    }
    size = truespring_memory(data, bytes);
    memory = malloc(size ? size : 1);
    done = memory ? truespring_open(&body, memory, size, data, bytes) : TRUESPRING_MEMORY;
    free(data); /* it is not needed any more */
    if (!done) {
        const double tolerance = sizeof(truespring_real) == sizeof(float) ? 1e-4 : 1e-9;
        truespring_reset(&body, 0); /* undeformed, without load */
        done = truespring_settle(&body, (truespring_real)tolerance, 1000000);
    }
    if (done < 0) {
        fprintf(stderr, "error %d: %s\n", done, truespring_error_text(done));
        free(memory);
        return 1;
    }
    printf("settled in %d steps of %.3g s\n", done, (double)body.step);
    print_displacement("displacement of", &body, body.x);
    if (body.equilibrium) print_displacement("expected for", &body, body.equilibrium);
    free(memory);
    return 0;
}
