/* truespring.h as a shared library, for the tests. */
#include <stdlib.h>
#include <time.h>

#include "truespring.h"

typedef struct {
    truespring_body body;
    void *memory;
} driven;

driven *driver_open(const void *data, size_t bytes, int *error)
{
    driven *one = (driven *)malloc(sizeof *one);
    size_t size = truespring_memory(data, bytes);
    one->memory = malloc(size ? size : 1);
    *error = truespring_open(&one->body, one->memory, size, data, bytes);
    if (!*error && !size) *error = -100;
    return one;
}

int driver_open_in(size_t missing, size_t shift, const void *data, size_t bytes)
{
    truespring_body body;
    size_t size = truespring_memory(data, bytes);
    char *memory = (char *)malloc(size + 8);
    int error = truespring_open(&body, memory + shift, size - missing, data, bytes);
    free(memory);
    return error;
}

void driver_close(driven *one)
{
    free(one->memory);
    free(one);
}

int driver_n_nodes(const driven *one) { return (int)one->body.n_nodes; }
int driver_probe(const driven *one) { return (int)one->body.probe; }
double driver_step_length(const driven *one) { return (double)one->body.step; }
double driver_stable_step(const driven *one) { return (double)one->body.stable_step; }
double driver_patch(const driven *one) { return (double)one->body.patch; }
double driver_time(const driven *one) { return one->body.time; }
truespring_real *driver_positions(driven *one) { return one->body.x; }
truespring_real *driver_velocities(driven *one) { return one->body.v; }
truespring_real *driver_loads(driven *one) { return one->body.load; }
const truespring_real *driver_masses(const driven *one) { return one->body.mass; }
const truespring_real *driver_grip_force(const driven *one, int number) { return one->body.grip[number].force; }
const truespring_real *driver_sphere_force(const driven *one, int number) { return one->body.ball[number].force; }
void driver_damping(driven *one, double alpha) { one->body.damping = (truespring_real)alpha; }
void driver_share(driven *one, double share) { one->body.share = (truespring_real)share; }
void driver_changed(driven *one) { truespring_changed(&one->body); }
void driver_reset(driven *one, double share) { truespring_reset(&one->body, (truespring_real)share); }
int driver_start(driven *one) { return truespring_start(&one->body); }
int driver_step(driven *one, double dt) { return truespring_step(&one->body, (truespring_real)dt); }
int driver_step_euler(driven *one, double dt) { return truespring_step_euler(&one->body, (truespring_real)dt); }
int driver_advance(driven *one, double dt) { return truespring_advance(&one->body, (truespring_real)dt); }
double driver_energy(driven *one) { return (double)truespring_energy(&one->body); }
double driver_kinetic_energy(const driven *one) { return (double)truespring_kinetic_energy(&one->body); }
double driver_force(const driven *one, truespring_real *force) { return (double)truespring_force(&one->body, force); }
const char *driver_text(int code) { return truespring_error_text(code); }
void driver_release(driven *one, int number) { truespring_release(&one->body, number); }

int driver_settle(driven *one, double tolerance, int most)
{
    return truespring_settle(&one->body, (truespring_real)tolerance, most);
}

int driver_pull(driven *one, int number, const truespring_real *point, const truespring_real *place, double radius,
                double stiffness)
{
    return truespring_pull(&one->body, number, point, place, (truespring_real)radius, (truespring_real)stiffness);
}

int driver_sphere(driven *one, int number, const truespring_real *centre, double radius, double stiffness)
{
    return truespring_sphere(&one->body, number, centre, (truespring_real)radius, (truespring_real)stiffness);
}

/* Seconds of the processor for n steps. */
double driver_seconds(driven *one, int n)
{
    clock_t begin = clock();
    int k;
    for (k = 0; k < n; k++) truespring_leapfrog(&one->body, one->body.step, 1);
    return (double)(clock() - begin) / CLOCKS_PER_SEC;
}
