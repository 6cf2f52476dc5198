/* Prints the seconds of the processor for a step of leapfrog: speed body.bin STEPS */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "truespring.h"

int main(int n, char **arguments)
{
    truespring_body body;
    FILE *file = n == 3 ? fopen(arguments[1], "rb") : NULL;
    long bytes, steps = n == 3 ? strtol(arguments[2], NULL, 10) : 0, k;
    unsigned char *data;
    size_t size;
    clock_t begin;
    if (!file || fseek(file, 0, SEEK_END) || (bytes = ftell(file)) <= 0 || fseek(file, 0, SEEK_SET)) return 2;
    data = (unsigned char *)malloc((size_t)bytes);
    if (!data || fread(data, 1, (size_t)bytes, file) != (size_t)bytes) return 2;
    size = truespring_memory(data, (size_t)bytes);
    if (truespring_open(&body, malloc(size), size, data, (size_t)bytes)) return 2;
    (void)truespring_start(&body);
    for (k = 0; k < steps / 10; k++) (void)truespring_step(&body, body.step);
    begin = clock();
    for (k = 0; k < steps; k++) (void)truespring_step(&body, body.step);
    printf("%.6g %lu\n", (double)(clock() - begin) / CLOCKS_PER_SEC / (double)steps, (unsigned long)size);
    return 0;
}
