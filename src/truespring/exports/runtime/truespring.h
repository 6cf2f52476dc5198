/* A body of springs that are true to their material, for any program in C99 or C++.
 *
 * It needs <math.h> and no other library, opens no file, and allocates no memory: the caller gives the data, a block of
 * memory that is used until the body is not needed any more, and a struct truespring_body. There is no global state:
 * open as many bodies as you like. Units are SI: m, N, kg, s. Positions have three components; a plane body lies in
 * z = 0.
 *
 *     truespring_body body;
 *     size_t size = truespring_memory(data, bytes);                    bytes of memory that the body needs
 *     int error = truespring_open(&body, memory, size, data, bytes);   0, or see truespring_error_text(error)
 *     truespring_start(&body);                                         the equilibrium under the full load, or
 *     truespring_reset(&body, 1);                                      undeformed, with this share of the load
 *     truespring_pull(&body, 0, point, place, 0, 0);                   hold the surface around a point and move it
 *     truespring_advance(&body, 1.0 / 60);                             a frame; read body.x
 *
 * Functions return 0 (or a count) or a negative error code. The data can be dropped after truespring_open.
 * #define TRUESPRING_REAL float before the include for single precision.
 */
#ifndef TRUESPRING_H
#define TRUESPRING_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifndef TRUESPRING_REAL
#define TRUESPRING_REAL double
#endif
#ifndef TRUESPRING_PARTS
#define TRUESPRING_PARTS 16 /* most groups of springs or elements of a body */
#endif
#ifndef TRUESPRING_GRIPS
#define TRUESPRING_GRIPS 8 /* most grasps at a time, at most 32 */
#endif
#ifndef TRUESPRING_SPHERES
#define TRUESPRING_SPHERES 8 /* most spheres at a time */
#endif

#define TRUESPRING_VERSION 1 /* of the data */

typedef TRUESPRING_REAL truespring_real;

enum {
    TRUESPRING_FOREIGN = -1,
    TRUESPRING_BYTE_ORDER = -2,
    TRUESPRING_OTHER_VERSION = -3,
    TRUESPRING_CUT = -4,
    TRUESPRING_CHECKSUM = -5,
    TRUESPRING_MEMORY = -6,
    TRUESPRING_ALIGNMENT = -7,
    TRUESPRING_INDEX = -8,
    TRUESPRING_VALUE = -9,
    TRUESPRING_KIND = -10,
    TRUESPRING_ARGUMENT = -11,
    TRUESPRING_NO_EQUILIBRIUM = -12,
    TRUESPRING_NOT_SETTLED = -13,
    TRUESPRING_UNSTABLE = -14,
    TRUESPRING_NO_SURFACE = -15
};

static inline const char *truespring_error_text(int code)
{
    switch (code) {
    case TRUESPRING_FOREIGN: return "the data is not a body written by truespring export --to c";
    case TRUESPRING_BYTE_ORDER: return "the data is little-endian and this machine is not";
    case TRUESPRING_OTHER_VERSION: return "the data has another version: export the body again, with this truespring.h";
    case TRUESPRING_CUT: return "the data is cut off, or longer than it states";
    case TRUESPRING_CHECKSUM: return "the data is damaged: its checksum is wrong";
    case TRUESPRING_MEMORY: return "the memory is too small: see truespring_memory";
    case TRUESPRING_ALIGNMENT: return "the memory is not aligned to 8 bytes";
    case TRUESPRING_INDEX: return "the data is invalid: a node number is out of range";
    case TRUESPRING_VALUE: return "the data is invalid: a number is not finite, or not positive where it must be";
    case TRUESPRING_KIND: return "the data is invalid: unknown kind of springs or elements, or too many groups of them";
    case TRUESPRING_ARGUMENT: return "an argument is out of range";
    case TRUESPRING_NO_EQUILIBRIUM: return "the data has no equilibrium: full load was not reached";
    case TRUESPRING_NOT_SETTLED: return "the body has not settled within the given number of steps";
    case TRUESPRING_UNSTABLE: return "positions are not finite: use a shorter step";
    case TRUESPRING_NO_SURFACE: return "no node of the surface is within the radius";
    default: return code < 0 ? "unknown error" : "no error";
    }
}

/* Kinds of groups, with the numbers of the file. */
enum {
    TRUESPRING_SPRINGS = 1, /* springs with a rest length */
    TRUESPRING_PULLS = 2,   /* springs of zero rest length and constant stiffness: Gaussian springs */
    TRUESPRING_VOLUMES = 3, /* an energy of the volume of each element, and of its links where these stiffen together */
    TRUESPRING_COUPLED = 4, /* links whose squared lengths are coupled within each element: biquadratic springs */
    TRUESPRING_POINTS = 5,  /* an energy of the volume at the points of elements of second order */
    TRUESPRING_FIBRES = 6   /* fibres: an energy of one quadratic form of the links of each element */
};

/* Laws of TRUESPRING_VOLUMES and TRUESPRING_POINTS; their constants. */
enum {
    TRUESPRING_NEO_HOOKEAN = 0, /* mu, lam; without links: the part mu/2 I1 is in TRUESPRING_PULLS */
    TRUESPRING_KAPPA = 1,       /* kappa/2 (J - 1)^2 */
    TRUESPRING_POLYNOMIAL = 2,  /* bulk, c1 to c5: sum of c_i (I1b - 3)^i (Yeoh, Arruda-Boyce) */
    TRUESPRING_GENT = 3         /* bulk, mu, jm */
};

/* How the volume of an element is computed. */
enum { TRUESPRING_BY_SIMPLICES = 0, TRUESPRING_HEXAHEDRON = 1, TRUESPRING_QUADRILATERAL = 2 };

#define TRUESPRING_MOST_CORNERS 10
#define TRUESPRING_MOST_LINKS 45
#define TRUESPRING_MOST_POINTS 8

typedef struct {
    uint32_t kind, count, corners; /* elements or springs, and the nodes of each */
    uint32_t law, sheet;           /* sheet: 1 in plane stress */
    uint32_t form, simplices, links, points, matrices;
    truespring_real scale; /* of the determinants of simplices */
    const uint32_t *nodes; /* count x corners */
    const uint32_t *simplex; /* simplices x (dim + 1), local */
    const uint32_t *link;    /* links x 2, local */
    const truespring_real *volume, *constants, *weights, *gradients;
} truespring_part;

typedef struct {
    int active;
    truespring_real at[3], radius, stiffness, areas; /* of the undeformed patch */
    truespring_real begin[3], end[3], now[3];        /* motion of the patch */
    truespring_real force[3];                        /* of the body on the grasp */
} truespring_grip;

typedef struct {
    int active;
    truespring_real radius, stiffness; /* stiffness: pressure per depth [Pa/m] */
    truespring_real begin[3], end[3], now[3];
    truespring_real force[3]; /* of the body on the sphere */
} truespring_ball;

typedef struct {
    /* The state: read or write, and call truespring_changed after writing. */
    truespring_real *x, *v;        /* positions [m] and velocities [m/s], n_nodes x 3 */
    truespring_real *load;         /* dead loads at share 1 [N], n_nodes x 3 */
    truespring_real share;         /* of loads and moved supports, 1 for the full load */
    truespring_real damping;       /* force against the velocity over mass [1/s] */
    truespring_real step;          /* longest time step [s], half of the largest stable one of the undeformed body */
    double time;                   /* [s] */
    /* The body: read only. */
    uint32_t n_nodes, dim, n_surface, n_parts, probe, ramp;
    truespring_real stable_step;   /* largest stable step of small motion about the undeformed body [s] */
    truespring_real patch, young, thickness; /* radius of a grasp by default; Young's modulus; 1 in space */
    const truespring_real *rest, *mass, *motion, *areas;
    const truespring_real *equilibrium; /* NULL if it is not known */
    const uint32_t *held;               /* bits 1, 2, 4: x, y, z are held */
    const uint32_t *surface;            /* nodes of the surface */
    truespring_part part[TRUESPRING_PARTS];
    /* Work. */
    truespring_real *f, *before; /* loads minus internal forces [N]; work */
    uint32_t *gripped;           /* a bit for each grasp, n_surface */
    int known;                   /* whether f belongs to x */
    truespring_grip grip[TRUESPRING_GRIPS];
    truespring_ball ball[TRUESPRING_SPHERES];
} truespring_body;

/* --- mathematics in the chosen precision ------------------------------------------------------------------------- */

#define TRUESPRING_SINGLE (sizeof(truespring_real) == sizeof(float))

static inline truespring_real truespring_sqrt(truespring_real a)
{
    return TRUESPRING_SINGLE ? (truespring_real)sqrtf((float)a) : (truespring_real)sqrt((double)a);
}

static inline truespring_real truespring_log(truespring_real a)
{
    return TRUESPRING_SINGLE ? (truespring_real)logf((float)a) : (truespring_real)log((double)a);
}

static inline truespring_real truespring_exp(truespring_real a)
{
    return TRUESPRING_SINGLE ? (truespring_real)expf((float)a) : (truespring_real)exp((double)a);
}

static inline truespring_real truespring_dot(const truespring_real *a, const truespring_real *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void truespring_cross(const truespring_real *a, const truespring_real *b, truespring_real *c)
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

static inline void truespring_between(const truespring_real *a, const truespring_real *b, truespring_real *d)
{
    d[0] = b[0] - a[0];
    d[1] = b[1] - a[1];
    d[2] = b[2] - a[2];
}

static inline void truespring_add(truespring_real *to, truespring_real factor, const truespring_real *d)
{
    to[0] += factor * d[0];
    to[1] += factor * d[1];
    to[2] += factor * d[2];
}

/* --- reading the data -------------------------------------------------------------------------------------------- */

typedef struct {
    const unsigned char *at;
    uint64_t left;
    unsigned char *memory; /* NULL: the memory is only counted */
    uint64_t size, used;
    int error;
} truespring_reader;

static inline uint64_t truespring_padded(uint64_t bytes) { return (bytes + 7) / 8 * 8; }

/* Read bytes, and the bytes up to a multiple of 8 after them; NULL if the data ends before. */
static inline const unsigned char *truespring_bytes(truespring_reader *from, uint64_t n)
{
    const unsigned char *here = from->at;
    n = truespring_padded(n);
    if (from->error) return NULL;
    if (n > from->left) {
        from->error = TRUESPRING_CUT;
        return NULL;
    }
    from->at += n;
    from->left -= n;
    return here;
}

/* Take a part of the memory; NULL while the memory is only counted. */
static inline void *truespring_take(truespring_reader *from, uint64_t n, uint64_t each)
{
    uint64_t bytes = truespring_padded(n * each), begin = from->used;
    if (from->error) return NULL;
    if (from->memory && bytes > from->size - begin) {
        from->error = TRUESPRING_MEMORY;
        return NULL;
    }
    from->used += bytes;
    return from->memory ? (void *)(from->memory + begin) : NULL;
}

static inline uint32_t truespring_number(truespring_reader *from)
{
    uint32_t value = 0;
    if (!from->error && from->left >= sizeof value) {
        memcpy(&value, from->at, sizeof value);
        from->at += sizeof value;
        from->left -= sizeof value;
    } else if (!from->error) {
        from->error = TRUESPRING_CUT;
    }
    return value;
}

static inline truespring_real truespring_value(truespring_reader *from)
{
    double value = 0;
    const unsigned char *here = truespring_bytes(from, sizeof value);
    if (here) memcpy(&value, here, sizeof value);
    if (!isfinite(value) && !from->error) from->error = TRUESPRING_VALUE;
    return (truespring_real)value;
}

/* Read n numbers below a limit. */
static inline const uint32_t *truespring_numbers(truespring_reader *from, uint64_t n, uint32_t limit)
{
    const unsigned char *here = truespring_bytes(from, n * sizeof(uint32_t));
    uint32_t *values = (uint32_t *)truespring_take(from, n, sizeof(uint32_t));
    uint64_t i;
    if (from->error || !values) return NULL;
    memcpy(values, here, (size_t)(n * sizeof(uint32_t)));
    for (i = 0; i < n; i++)
        if (values[i] >= limit) from->error = TRUESPRING_INDEX;
    return values;
}

/* Read n finite values, above zero if `positive`. */
static inline truespring_real *truespring_values(truespring_reader *from, uint64_t n, int positive)
{
    const unsigned char *here = truespring_bytes(from, n * sizeof(double));
    truespring_real *values = (truespring_real *)truespring_take(from, n, sizeof(truespring_real));
    uint64_t i;
    if (from->error || !values) return NULL;
    for (i = 0; i < n; i++) {
        double value;
        memcpy(&value, here + i * sizeof value, sizeof value);
        values[i] = (truespring_real)value;
        if (!isfinite(values[i]) || (positive && !(values[i] > 0))) from->error = TRUESPRING_VALUE;
    }
    return values;
}

static inline uint32_t truespring_n_constants(uint32_t law)
{
    return law == TRUESPRING_POLYNOMIAL ? 6 : law == TRUESPRING_GENT ? 3 : law == TRUESPRING_KAPPA ? 1 : 2;
}

/* Whether the counts of a group fit its kind. */
static inline int truespring_fits(const truespring_part *p, uint32_t dim)
{
    int volumes = p->kind == TRUESPRING_VOLUMES, points = p->kind == TRUESPRING_POINTS;
    int linked = p->kind == TRUESPRING_COUPLED || p->kind == TRUESPRING_FIBRES;
    if (p->kind < TRUESPRING_SPRINGS || p->kind > TRUESPRING_FIBRES) return 0;
    if (p->corners < 2 || p->corners > TRUESPRING_MOST_CORNERS || p->links > TRUESPRING_MOST_LINKS) return 0;
    if (p->points > TRUESPRING_MOST_POINTS || p->simplices > 64 || p->sheet > 1) return 0;
    if (p->kind <= TRUESPRING_PULLS) {
        return p->corners == 2 && (p->law == 0 || (p->kind == TRUESPRING_SPRINGS && (p->law == 2 || p->law == 3)));
    }
    if (linked) return p->links > 0 && (p->matrices == 1 || p->matrices == p->count);
    if (p->law > TRUESPRING_GENT || (p->sheet && dim != 2)) return 0;
    if (points) return p->law == TRUESPRING_NEO_HOOKEAN && p->points > 0;
    if (volumes && p->law >= TRUESPRING_POLYNOMIAL && !p->links) return 0;
    if (p->form == TRUESPRING_HEXAHEDRON) return p->corners == 8 && dim == 3;
    if (p->form == TRUESPRING_QUADRILATERAL) return p->corners == 4 && dim == 2;
    return p->form == TRUESPRING_BY_SIMPLICES && p->simplices > 0;
}

static inline void truespring_read_part(truespring_reader *from, const truespring_body *body, truespring_part *p)
{
    uint64_t n, links;
    p->kind = truespring_number(from);
    p->count = truespring_number(from);
    p->corners = truespring_number(from);
    p->law = truespring_number(from);
    p->sheet = truespring_number(from);
    p->form = truespring_number(from);
    p->simplices = truespring_number(from);
    p->links = truespring_number(from);
    p->points = truespring_number(from);
    p->matrices = truespring_number(from);
    p->scale = truespring_value(from);
    if (!from->error && !truespring_fits(p, body->dim)) from->error = TRUESPRING_KIND;
    if (from->error) return;
    n = p->count;
    links = p->links;
    p->nodes = truespring_numbers(from, n * p->corners, body->n_nodes);
    p->simplex = truespring_numbers(from, (uint64_t)p->simplices * (body->dim + 1), p->corners);
    p->link = truespring_numbers(from, links * 2, p->corners);
    switch (p->kind) {
    case TRUESPRING_SPRINGS:
        p->constants = truespring_values(from, n, 0); /* stiffness */
        p->weights = truespring_values(from, n, 1);   /* rest length */
        break;
    case TRUESPRING_PULLS: p->constants = truespring_values(from, n, 0); break;
    case TRUESPRING_VOLUMES:
        p->volume = truespring_values(from, n, 1);
        p->constants = truespring_values(from, n * truespring_n_constants(p->law), 0);
        p->weights = truespring_values(from, n * links, 0);
        break;
    case TRUESPRING_COUPLED: p->constants = truespring_values(from, p->matrices * links * links, 0); break;
    case TRUESPRING_POINTS:
        p->volume = truespring_values(from, n * p->points, 1);
        p->constants = truespring_values(from, n * 2, 0);
        p->gradients = truespring_values(from, n * p->points * p->corners * 3, 0);
        break;
    default:
        p->volume = truespring_values(from, n, 1);
        p->constants = truespring_values(from, n * 2, 0); /* k1, k2 */
        p->weights = truespring_values(from, n * links, 0);
        break;
    }
}

/* The checksum CRC-32 of zlib and PNG, four bits at a time. */
static inline uint64_t truespring_checksum(const unsigned char *data, uint64_t n)
{
    uint32_t table[16], sum = UINT32_C(0xffffffff), k, bit;
    uint64_t i;
    for (k = 0; k < 16; k++) {
        table[k] = k;
        for (bit = 0; bit < 4; bit++) table[k] = table[k] >> 1 ^ (table[k] & 1 ? UINT32_C(0xedb88320) : 0);
    }
    for (i = 0; i < n; i++) {
        sum ^= data[i];
        sum = sum >> 4 ^ table[sum & 15];
        sum = sum >> 4 ^ table[sum & 15];
    }
    return sum ^ UINT32_C(0xffffffff);
}

/* Check the first 32 bytes, and place the reader after them. */
static inline void truespring_read_head(truespring_reader *from, const void *data, size_t bytes)
{
    const unsigned char *begin = (const unsigned char *)data;
    uint64_t length = 0, sum = 0;
    from->at = begin;
    from->left = bytes;
    if (!data || bytes < 32 || memcmp(begin, "TRSPRING", 8) != 0) {
        from->error = data && bytes < 32 && bytes > 8 && memcmp(begin, "TRSPRING", 8) == 0 ? TRUESPRING_CUT
                                                                                          : TRUESPRING_FOREIGN;
        return;
    }
    from->at += 8;
    from->left -= 8;
    if (truespring_number(from) != UINT32_C(0x01020304)) from->error = TRUESPRING_BYTE_ORDER;
    if (truespring_number(from) != TRUESPRING_VERSION && !from->error) from->error = TRUESPRING_OTHER_VERSION;
    if (from->error) return;
    memcpy(&length, from->at, 8);
    memcpy(&sum, from->at + 8, 8);
    from->at += 16;
    from->left -= 16;
    if (length != bytes) from->error = TRUESPRING_CUT;
    else if (truespring_checksum(from->at, from->left) != sum) from->error = TRUESPRING_CHECKSUM;
}

/* Read the whole data; without memory only count it. */
static inline void truespring_read(truespring_reader *from, truespring_body *body, const void *data, size_t bytes)
{
    uint64_t n;
    uint32_t i, balanced;
    memset(body, 0, sizeof *body);
    truespring_read_head(from, data, bytes);
    body->n_nodes = truespring_number(from);
    body->dim = truespring_number(from);
    body->n_surface = truespring_number(from);
    body->n_parts = truespring_number(from);
    body->probe = truespring_number(from);
    body->ramp = truespring_number(from);
    balanced = truespring_number(from);
    (void)truespring_number(from); /* not used */
    body->stable_step = truespring_value(from);
    body->patch = truespring_value(from);
    body->young = truespring_value(from);
    body->thickness = truespring_value(from);
    if (from->error) return;
    if (body->n_parts > TRUESPRING_PARTS) from->error = TRUESPRING_KIND;
    if (body->probe >= body->n_nodes || (body->dim != 2 && body->dim != 3)) from->error = TRUESPRING_INDEX;
    if (!(body->stable_step > 0) || !(body->patch > 0)) from->error = TRUESPRING_VALUE;
    n = body->n_nodes;
    body->rest = truespring_values(from, n * 3, 0);
    body->mass = truespring_values(from, n, 1);
    body->load = truespring_values(from, n * 3, 0);
    body->motion = truespring_values(from, n * 3, 0);
    body->held = truespring_numbers(from, n, 8);
    body->surface = truespring_numbers(from, body->n_surface, body->n_nodes);
    body->areas = truespring_values(from, body->n_surface, 1);
    if (balanced) body->equilibrium = truespring_values(from, n * 3, 0);
    for (i = 0; i < body->n_parts && !from->error; i++) truespring_read_part(from, body, &body->part[i]);
    if (!from->error && from->left) from->error = TRUESPRING_CUT;
    body->x = (truespring_real *)truespring_take(from, n * 3, sizeof(truespring_real));
    body->v = (truespring_real *)truespring_take(from, n * 3, sizeof(truespring_real));
    body->f = (truespring_real *)truespring_take(from, n * 3, sizeof(truespring_real));
    body->before = (truespring_real *)truespring_take(from, n * 3, sizeof(truespring_real));
    body->gripped = (uint32_t *)truespring_take(from, body->n_surface, sizeof(uint32_t));
}

/* Return the bytes of memory that a body needs; 0 if the head or a count is wrong: truespring_open then returns why. */
static inline size_t truespring_memory(const void *data, size_t bytes)
{
    truespring_reader from;
    truespring_body body;
    memset(&from, 0, sizeof from);
    truespring_read(&from, &body, data, bytes);
    return from.error || from.used > SIZE_MAX ? 0 : (size_t)from.used;
}

static inline void truespring_reset(truespring_body *body, truespring_real share);

/* Open a body in a block of memory, which the body uses from now on; it is undeformed, at rest, under the full load. */
static inline int truespring_open(truespring_body *body, void *memory, size_t size, const void *data, size_t bytes)
{
    truespring_reader from;
    if (!body) return TRUESPRING_ARGUMENT;
    memset(&from, 0, sizeof from);
    truespring_read(&from, body, data, bytes); /* counts the memory */
    if (!from.error && from.used > size) from.error = TRUESPRING_MEMORY;
    if (!from.error && !memory) from.error = TRUESPRING_MEMORY;
    if (!from.error && (uintptr_t)memory % 8 != 0) from.error = TRUESPRING_ALIGNMENT;
    if (!from.error) {
        memset(&from, 0, sizeof from);
        from.memory = (unsigned char *)memory;
        from.size = size;
        truespring_read(&from, body, data, bytes);
    }
    if (from.error) {
        memset(body, 0, sizeof *body);
        return from.error;
    }
    body->step = body->stable_step / 2;
    if (body->n_surface) memset(body->gripped, 0, body->n_surface * sizeof(uint32_t));
    truespring_reset(body, 1);
    return 0;
}

/* --- the volume of an element, and its derivatives by the nodes -------------------------------------------------- */

/* Of the trilinear hexahedron, nodes in VTK's order (Flanagan and Belytschko, Int. J. Numer. Meth. Eng. 17, 1981). With
 * the sums a_1 of the corners times the sign of xi, h_1 times the sign of eta zeta, and so on:
 * V = (det(a1, a2, a3) + (det(a1, h3, h2) + det(h3, a2, h1) + det(h2, h1, a3)) / 3) / 64. */
static inline truespring_real truespring_hexahedron(const truespring_real *x, const uint32_t *node,
                                                    truespring_real slope[][3])
{
    truespring_real mode[3][6], by[3][6], total = 0;
    int d, q;
    for (d = 0; d < 3; d++) {
        truespring_real x0 = x[3 * (size_t)node[0] + d], x1 = x[3 * (size_t)node[1] + d];
        truespring_real x2 = x[3 * (size_t)node[2] + d], x3 = x[3 * (size_t)node[3] + d];
        truespring_real x4 = x[3 * (size_t)node[4] + d], x5 = x[3 * (size_t)node[5] + d];
        truespring_real x6 = x[3 * (size_t)node[6] + d], x7 = x[3 * (size_t)node[7] + d];
        truespring_real low = x0 + x4, right = x1 + x5, high = x2 + x6, left = x3 + x7;
        truespring_real up_low = x4 - x0, up_right = x5 - x1, up_high = x6 - x2, up_left = x7 - x3;
        mode[d][0] = (right - low) + (high - left);
        mode[d][1] = (left + high) - (low + right);
        mode[d][2] = (up_low + up_right) + (up_left + up_high);
        mode[d][3] = (up_left + up_high) - (up_low + up_right);
        mode[d][4] = (up_right - up_low) + (up_high - up_left);
        mode[d][5] = (high - left) - (right - low);
    }
    for (d = 0; d < 3; d++) {
        const truespring_real *a = mode[(d + 1) % 3], *b = mode[(d + 2) % 3]; /* a1 a2 a3 h1 h2 h3 */
        truespring_real *g = by[d];
        g[0] = (a[1] * b[2] - a[2] * b[1] + (a[5] * b[4] - a[4] * b[5]) / 3) / 64;
        g[1] = (a[2] * b[0] - a[0] * b[2] + (a[3] * b[5] - a[5] * b[3]) / 3) / 64;
        g[2] = (a[0] * b[1] - a[1] * b[0] + (a[4] * b[3] - a[3] * b[4]) / 3) / 64;
        g[3] = (a[5] * b[1] - a[1] * b[5] + a[2] * b[4] - a[4] * b[2]) / 192;
        g[4] = (a[0] * b[5] - a[5] * b[0] + a[3] * b[2] - a[2] * b[3]) / 192;
        g[5] = (a[4] * b[0] - a[0] * b[4] + a[1] * b[3] - a[3] * b[1]) / 192;
        for (q = 0; q < 6; q++) total += mode[d][q] * g[q];
    }
    for (d = 0; d < 3; d++) {
        const truespring_real *g = by[d];
        truespring_real low = g[5] - g[0] - g[1], right = g[0] - g[1] - g[5];
        truespring_real high = g[0] + g[1] + g[5], left = g[1] - g[0] - g[5];
        truespring_real up_low = g[2] - g[3] - g[4], up_right = g[2] - g[3] + g[4];
        truespring_real up_high = g[2] + g[3] + g[4], up_left = g[2] + g[3] - g[4];
        slope[0][d] = low - up_low, slope[4][d] = low + up_low;
        slope[1][d] = right - up_right, slope[5][d] = right + up_right;
        slope[2][d] = high - up_high, slope[6][d] = high + up_high;
        slope[3][d] = left - up_left, slope[7][d] = left + up_left;
    }
    return total / 3;
}

/* Of a quadrilateral: half the cross product of its diagonals, times the thickness. */
static inline truespring_real truespring_quadrilateral(const truespring_real *x, const uint32_t *node,
                                                       truespring_real thickness, truespring_real slope[][3])
{
    truespring_real p[3], q[3], half = thickness / 2;
    truespring_between(x + 3 * (size_t)node[0], x + 3 * (size_t)node[2], p);
    truespring_between(x + 3 * (size_t)node[1], x + 3 * (size_t)node[3], q);
    slope[0][0] = -half * q[1], slope[0][1] = half * q[0], slope[0][2] = 0;
    slope[2][0] = half * q[1], slope[2][1] = -half * q[0], slope[2][2] = 0;
    slope[1][0] = half * p[1], slope[1][1] = -half * p[0], slope[1][2] = 0;
    slope[3][0] = -half * p[1], slope[3][1] = half * p[0], slope[3][2] = 0;
    return half * (p[0] * q[1] - p[1] * q[0]);
}

/* Of an element that is a weighted sum of triangles or tetrahedra. */
static inline truespring_real truespring_of_simplices(const truespring_part *p, const truespring_real *x,
                                                      const uint32_t *node, uint32_t dim, truespring_real slope[][3])
{
    truespring_real total = 0;
    uint32_t s, a;
    for (a = 0; a < p->corners; a++) slope[a][0] = slope[a][1] = slope[a][2] = 0;
    for (s = 0; s < p->simplices; s++) {
        const uint32_t *local = p->simplex + s * (dim + 1);
        const truespring_real *origin = x + 3 * (size_t)node[local[0]];
        truespring_real one[3], two[3], three[3] = {0, 0, 1}, by[3];
        truespring_between(origin, x + 3 * (size_t)node[local[1]], one);
        truespring_between(origin, x + 3 * (size_t)node[local[2]], two);
        if (dim == 3) truespring_between(origin, x + 3 * (size_t)node[local[3]], three);
        truespring_cross(two, three, by);
        total += p->scale * truespring_dot(one, by);
        truespring_add(slope[local[1]], p->scale, by);
        truespring_add(slope[local[0]], -p->scale, by);
        truespring_cross(three, one, by);
        truespring_add(slope[local[2]], p->scale, by);
        truespring_add(slope[local[0]], -p->scale, by);
        if (dim == 2) continue;
        truespring_cross(one, two, by);
        truespring_add(slope[local[3]], p->scale, by);
        truespring_add(slope[local[0]], -p->scale, by);
    }
    return total;
}

static inline truespring_real truespring_volume(const truespring_part *p, const truespring_real *x,
                                                const uint32_t *node, uint32_t dim, truespring_real slope[][3])
{
    if (p->form == TRUESPRING_HEXAHEDRON) return truespring_hexahedron(x, node, slope);
    if (p->form == TRUESPRING_QUADRILATERAL) return truespring_quadrilateral(x, node, p->scale, slope);
    return truespring_of_simplices(p, x, node, dim, slope);
}

/* --- laws -------------------------------------------------------------------------------------------------------- */

/* An energy density [J/m^3] and its derivatives by I1, the trace of C, and y = ln J. */
typedef struct {
    truespring_real w, i, y, ii, iy, yy;
} truespring_density;

/* psi(I1b) and its derivatives. Gent's is continued linearly near its limit, where it is infinite. */
static inline void truespring_psi(uint32_t law, const truespring_real *c, truespring_real b, truespring_real *psi)
{
    truespring_real z = b - 3, left, least = (truespring_real)1 / 100;
    if (law == TRUESPRING_POLYNOMIAL) {
        psi[0] = z * (c[1] + z * (c[2] + z * (c[3] + z * (c[4] + z * c[5]))));
        psi[1] = c[1] + z * (2 * c[2] + z * (3 * c[3] + z * (4 * c[4] + z * 5 * c[5])));
        psi[2] = 2 * c[2] + z * (6 * c[3] + z * (12 * c[4] + z * 20 * c[5]));
        return;
    }
    left = 1 - z / c[2];
    psi[0] = -c[1] * c[2] / 2 * truespring_log(left > least ? left : least);
    psi[1] = c[1] / 2 / (left > least ? left : least);
    psi[2] = left > least ? c[1] / 2 / c[2] / (left * left) : 0;
    if (!(left > least)) psi[0] += psi[1] * c[2] * (least - left);
}

static inline truespring_density truespring_in_space(uint32_t law, const truespring_real *c, truespring_real I1,
                                                     truespring_real y)
{
    truespring_density at;
    truespring_real psi[3], shrunk, b;
    if (law == TRUESPRING_NEO_HOOKEAN) { /* mu/2 (I1 - 3) - mu y + lam/2 y^2 */
        at.w = c[0] / 2 * (I1 - 3) - c[0] * y + c[1] / 2 * y * y;
        at.i = c[0] / 2;
        at.y = c[1] * y - c[0];
        at.ii = at.iy = 0;
        at.yy = c[1];
        return at;
    }
    shrunk = truespring_exp(-2 * y / 3); /* psi(I1b) + bulk/2 y^2 */
    b = I1 * shrunk;
    truespring_psi(law, c, b, psi);
    at.w = psi[0] + c[0] / 2 * y * y;
    at.i = psi[1] * shrunk;
    at.y = -2 * b * psi[1] / 3 + c[0] * y;
    at.ii = psi[2] * shrunk * shrunk;
    at.iy = -2 * shrunk * (psi[1] + b * psi[2]) / 3;
    at.yy = 4 * b * (psi[1] + b * psi[2]) / 9 + c[0];
    return at;
}

/* In plane stress: C33 = exp(z) is that of the least energy, by Newton's method. I1 and y are those of the plane. */
static inline truespring_density truespring_of_sheet(uint32_t law, const truespring_real *c, truespring_real I1,
                                                     truespring_real y)
{
    const truespring_real enough = (truespring_real)(TRUESPRING_SINGLE ? 1e-8 : 1e-17);
    truespring_real lam = c[1], mu = c[0], z, C = 1, mixed, curvature = 1;
    truespring_density at;
    int k;
    if (law != TRUESPRING_NEO_HOOKEAN) {
        mu = law == TRUESPRING_GENT ? c[1] : 2 * c[1];
        lam = c[0] - 2 * mu / 3;
    }
    z = -2 * lam / (lam + 2 * mu) * y;
    z = z > 50 ? 50 : z > -50 ? z : -50;
    for (k = 0; k < 60; k++) {
        truespring_real slope, change;
        C = truespring_exp(z);
        at = truespring_in_space(law, c, I1 + C, y + z / 2);
        slope = C * at.i + at.y / 2;
        curvature = C * at.i + C * (C * at.ii + at.iy) + at.yy / 4;
        change = slope / (curvature > 0 ? curvature : (slope < 0 ? -slope : slope) + mu);
        change = change > 2 ? 2 : change > -2 ? change : -2;
        z -= change;
        if (change * change <= enough) break; /* the error that is left is about the square of the change */
    }
    C = truespring_exp(z);
    at = truespring_in_space(law, c, I1 + C, y + z / 2);
    curvature = C * at.i + C * (C * at.ii + at.iy) + at.yy / 4;
    mixed = C * at.iy + at.yy / 2;
    if (curvature > 0) at.yy -= mixed * mixed / curvature;
    return at;
}

typedef struct {
    truespring_real w, i, J; /* energy density and its derivatives by I1 and the volume ratio J */
} truespring_response;

/* The response of a law; below J = 0.1 the derivative by J is continued linearly, so that inverted elements unfold. */
static inline truespring_response truespring_law(uint32_t law, uint32_t sheet, const truespring_real *c,
                                                 truespring_real I1, truespring_real J, uint32_t dim)
{
    const truespring_real smallest = (truespring_real)1 / 10;
    truespring_real kept = J > smallest ? J : smallest, y, more;
    truespring_response found;
    truespring_density at;
    if (law == TRUESPRING_KAPPA) {
        found.w = c[0] / 2 * (J - 1) * (J - 1);
        found.i = 0;
        found.J = c[0] * (J - 1);
        return found;
    }
    y = truespring_log(kept);
    at = sheet ? truespring_of_sheet(law, c, I1, y) : truespring_in_space(law, c, dim == 2 ? I1 + 1 : I1, y);
    found.w = at.w;
    found.i = at.i;
    found.J = at.y / kept;
    if (!(J > smallest)) {
        more = (at.yy - at.y) / (kept * kept);
        found.w += (found.J + more / 2 * (J - kept)) * (J - kept);
        found.J += more * (J - kept);
    }
    return found;
}

/* --- energy and forces of the groups: each function adds forces (the gradient) to f and returns the energy ------- */

static inline truespring_real truespring_springs(const truespring_part *p, const truespring_real *x, truespring_real *f)
{
    truespring_real energy = 0;
    uint32_t s;
    for (s = 0; s < p->count; s++) {
        size_t a = 3 * (size_t)p->nodes[2 * (size_t)s], b = 3 * (size_t)p->nodes[2 * (size_t)s + 1];
        truespring_real k = p->constants[s], rest = p->weights[s], d[3], length, pull;
        truespring_between(x + a, x + b, d);
        length = truespring_sqrt(truespring_dot(d, d));
        if (!(length > 0)) continue; /* without direction */
        if (p->law == 0) {
            pull = k * (length - rest) / length;
            energy += k / 2 * (length - rest) * (length - rest);
        } else { /* k L (s - s^-(d+1)) / (d + 2), s = l / L */
            truespring_real n = (truespring_real)p->law, r = rest / length, power = p->law == 2 ? r * r : r * r * r;
            pull = k / (n + 2) * (1 - r * r * power);
            energy += k * rest * rest / (n + 2) * ((1 / (r * r) - 1) / 2 + (power - 1) / n);
        }
        truespring_add(f + a, -pull, d);
        truespring_add(f + b, pull, d);
    }
    return energy;
}

static inline truespring_real truespring_pulls(const truespring_part *p, const truespring_real *x, truespring_real *f)
{
    truespring_real energy = 0;
    uint32_t s;
    for (s = 0; s < p->count; s++) {
        size_t a = 3 * (size_t)p->nodes[2 * (size_t)s], b = 3 * (size_t)p->nodes[2 * (size_t)s + 1];
        truespring_real k = p->constants[s], d[3];
        truespring_between(x + a, x + b, d);
        energy += k / 2 * truespring_dot(d, d);
        truespring_add(f + a, -k, d);
        truespring_add(f + b, k, d);
    }
    return energy;
}

/* The sum over the links of an element of weight times squared length. */
static inline truespring_real truespring_form(const truespring_part *p, const truespring_real *x, const uint32_t *node,
                                              const truespring_real *weight)
{
    truespring_real sum = 0, d[3];
    uint32_t l;
    for (l = 0; l < p->links; l++) {
        truespring_between(x + 3 * (size_t)node[p->link[2 * l]], x + 3 * (size_t)node[p->link[2 * l + 1]], d);
        sum += weight[l] * truespring_dot(d, d);
    }
    return sum;
}

/* Add the forces of links of the stiffness factor times weight. */
static inline void truespring_pull_links(const truespring_part *p, const truespring_real *x, const uint32_t *node,
                                         truespring_real factor, const truespring_real *weight, truespring_real *f)
{
    truespring_real d[3];
    uint32_t l;
    for (l = 0; l < p->links; l++) {
        size_t a = 3 * (size_t)node[p->link[2 * l]], b = 3 * (size_t)node[p->link[2 * l + 1]];
        truespring_between(x + a, x + b, d);
        truespring_add(f + a, -factor * weight[l], d);
        truespring_add(f + b, factor * weight[l], d);
    }
}

static inline truespring_real truespring_volumes(const truespring_part *p, const truespring_real *x, truespring_real *f,
                                                 uint32_t dim)
{
    truespring_real energy = 0, slope[TRUESPRING_MOST_CORNERS][3];
    uint32_t e, a, n = truespring_n_constants(p->law);
    for (e = 0; e < p->count; e++) {
        const uint32_t *node = p->nodes + (size_t)e * p->corners;
        const truespring_real *weight = p->weights + (size_t)e * p->links, *c = p->constants + (size_t)e * n;
        truespring_real volume = truespring_volume(p, x, node, dim, slope), undeformed = p->volume[e];
        truespring_real I1 = p->links ? truespring_form(p, x, node, weight) / undeformed : 0;
        truespring_response at = truespring_law(p->law, p->sheet, c, I1, volume / undeformed, dim);
        energy += undeformed * at.w;
        for (a = 0; a < p->corners; a++) truespring_add(f + 3 * (size_t)node[a], at.J, slope[a]);
        if (p->links) truespring_pull_links(p, x, node, 2 * at.i, weight, f);
    }
    return energy;
}

/* Energy q . M q of each element, with q the changes of the squared lengths of its links. */
static inline truespring_real truespring_coupled(const truespring_part *p, const truespring_real *x,
                                                 const truespring_real *rest, truespring_real *f)
{
    truespring_real energy = 0, q[TRUESPRING_MOST_LINKS], d[TRUESPRING_MOST_LINKS][3], before[3];
    uint32_t e, l, m;
    for (e = 0; e < p->count; e++) {
        const uint32_t *node = p->nodes + (size_t)e * p->corners;
        const truespring_real *M = p->constants + (p->matrices > 1 ? (size_t)e * p->links * p->links : 0);
        for (l = 0; l < p->links; l++) {
            size_t a = 3 * (size_t)node[p->link[2 * l]], b = 3 * (size_t)node[p->link[2 * l + 1]];
            truespring_between(x + a, x + b, d[l]);
            truespring_between(rest + a, rest + b, before);
            q[l] = 0;
            for (m = 0; m < 3; m++) q[l] += (d[l][m] - before[m]) * (d[l][m] + before[m]);
        }
        for (l = 0; l < p->links; l++) {
            size_t a = 3 * (size_t)node[p->link[2 * l]], b = 3 * (size_t)node[p->link[2 * l + 1]];
            truespring_real pull = 0;
            for (m = 0; m < p->links; m++) pull += M[(size_t)l * p->links + m] * q[m];
            energy += q[l] * pull;
            truespring_add(f + a, -4 * pull, d[l]);
            truespring_add(f + b, 4 * pull, d[l]);
        }
    }
    return energy;
}

/* The cofactors of the deformation gradient at a point, and its determinant. */
static inline truespring_real truespring_gradient(const truespring_part *p, const truespring_real *x,
                                                  const uint32_t *node, const truespring_real *gradient, uint32_t dim,
                                                  truespring_real cofactor[3][3])
{
    truespring_real F[3][3] = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    uint32_t a;
    int i;
    for (a = 0; a < p->corners; a++)
        for (i = 0; i < 3; i++) truespring_add(F[i], x[3 * (size_t)node[a] + i], gradient + 3 * a);
    if (dim == 2) F[2][2] = 1;
    truespring_cross(F[1], F[2], cofactor[0]);
    truespring_cross(F[2], F[0], cofactor[1]);
    truespring_cross(F[0], F[1], cofactor[2]);
    return truespring_dot(F[0], cofactor[0]);
}

/* The volume function of elements of second order: that of mu at the points, that of lam at the mean volume of the
 * element; in plane stress all of it at the points. */
static inline truespring_real truespring_points(const truespring_part *p, const truespring_real *x, truespring_real *f,
                                                uint32_t dim)
{
    truespring_real energy = 0, J[TRUESPRING_MOST_POINTS], cofactor[TRUESPRING_MOST_POINTS][3][3];
    uint32_t e, q, a;
    int i;
    for (e = 0; e < p->count; e++) {
        const uint32_t *node = p->nodes + (size_t)e * p->corners;
        const truespring_real *gradient = p->gradients + (size_t)e * p->points * p->corners * 3;
        const truespring_real *v = p->volume + (size_t)e * p->points, *c = p->constants + 2 * (size_t)e;
        truespring_real own[2], mean[2], whole = 0, now = 0;
        truespring_response all;
        own[0] = c[0], own[1] = p->sheet ? c[1] : 0;
        mean[0] = 0, mean[1] = p->sheet ? 0 : c[1];
        for (q = 0; q < p->points; q++) {
            J[q] = truespring_gradient(p, x, node, gradient + (size_t)q * p->corners * 3, dim, cofactor[q]);
            whole += v[q];
            now += v[q] * J[q];
        }
        all = truespring_law(TRUESPRING_NEO_HOOKEAN, 0, mean, 0, now / whole, dim);
        energy += whole * all.w;
        for (q = 0; q < p->points; q++) {
            truespring_response at = truespring_law(TRUESPRING_NEO_HOOKEAN, p->sheet, own, 0, J[q], dim);
            energy += v[q] * at.w;
            for (a = 0; a < p->corners; a++)
                for (i = 0; i < 3; i++)
                    f[3 * (size_t)node[a] + i] +=
                        v[q] * (at.J + all.J) *
                        truespring_dot(cofactor[q][i], gradient + 3 * ((size_t)q * p->corners + a));
        }
    }
    return energy;
}

/* k1 / (2 k2) (exp(k2 <I4 - 1>^2) - 1), I4 the square of the stretch of the fibres. */
static inline truespring_real truespring_fibres(const truespring_part *p, const truespring_real *x, truespring_real *f)
{
    truespring_real energy = 0;
    uint32_t e;
    for (e = 0; e < p->count; e++) {
        const uint32_t *node = p->nodes + (size_t)e * p->corners;
        const truespring_real *weight = p->weights + (size_t)e * p->links, *c = p->constants + 2 * (size_t)e;
        truespring_real strain = truespring_form(p, x, node, weight) / p->volume[e] - 1, grown;
        if (!(strain > 0)) continue;
        grown = truespring_exp(c[1] * strain * strain);
        energy += p->volume[e] * (c[1] > 0 ? c[0] / (2 * c[1]) * (grown - 1) : c[0] / 2 * strain * strain);
        truespring_pull_links(p, x, node, 2 * c[0] * strain * grown, weight, f);
    }
    return energy;
}

/* Add the internal forces at positions x, the gradient of the energy, to f; return the energy [J]. */
static inline truespring_real truespring_elastic(const truespring_body *body, const truespring_real *x,
                                                 truespring_real *f)
{
    truespring_real energy = 0;
    uint32_t i;
    for (i = 0; i < body->n_parts; i++) {
        const truespring_part *p = &body->part[i];
        switch (p->kind) {
        case TRUESPRING_SPRINGS: energy += truespring_springs(p, x, f); break;
        case TRUESPRING_PULLS: energy += truespring_pulls(p, x, f); break;
        case TRUESPRING_VOLUMES: energy += truespring_volumes(p, x, f, body->dim); break;
        case TRUESPRING_COUPLED: energy += truespring_coupled(p, x, body->rest, f); break;
        case TRUESPRING_POINTS: energy += truespring_points(p, x, f, body->dim); break;
        default: energy += truespring_fibres(p, x, f); break;
        }
    }
    return energy;
}

/* --- grasps and spheres ------------------------------------------------------------------------------------------- */

/* They act from the time on at which they are added, up to that at which they are removed: a step begins with the
 * forces of the end of the last one. */

/* Call it after writing positions or loads. The share of the load may change between steps without it: a step begins
 * with the loads of the end of the last one. */
static inline void truespring_changed(truespring_body *body) { body->known = 0; }

static inline int truespring_all_finite(const truespring_real *values, int n)
{
    int i;
    for (i = 0; i < n; i++)
        if (!isfinite(values[i])) return 0;
    return 1;
}

/* The node of the surface that is nearest to a place on the body as it is now. The body must have a surface. */
static inline uint32_t truespring_nearest(const truespring_body *body, const truespring_real *place)
{
    uint32_t q, found = body->surface[0];
    truespring_real least = -1, d[3];
    for (q = 0; q < body->n_surface; q++) {
        truespring_between(place, body->x + 3 * (size_t)body->surface[q], d);
        if (least < 0 || truespring_dot(d, d) < least) {
            least = truespring_dot(d, d);
            found = body->surface[q];
        }
    }
    return found;
}

static inline void truespring_release(truespring_body *body, int number)
{
    uint32_t q;
    if (number < 0 || number >= TRUESPRING_GRIPS) return;
    for (q = 0; q < body->n_surface; q++) body->gripped[q] &= ~(UINT32_C(1) << number);
    body->grip[number].active = 0;
}

/* Hold the nodes of the surface around a point by springs, where they are. */
static inline int truespring_grip_at(truespring_body *body, int number, const truespring_real *point,
                                     truespring_real radius, truespring_real stiffness)
{
    truespring_grip *g = &body->grip[number];
    truespring_real d[3];
    uint32_t q;
    int c;
    if (!body->n_surface) return TRUESPRING_NO_SURFACE;
    memcpy(g->at, body->rest + 3 * (size_t)truespring_nearest(body, point), sizeof g->at);
    g->radius = radius > 0 ? radius : body->patch;
    g->stiffness = stiffness > 0 ? stiffness : body->young * (body->dim == 3 ? g->radius : body->thickness);
    if (!(g->stiffness > 0)) return TRUESPRING_ARGUMENT; /* a network has no Young's modulus */
    g->areas = g->begin[0] = g->begin[1] = g->begin[2] = 0;
    for (q = 0; q < body->n_surface; q++) {
        size_t i = 3 * (size_t)body->surface[q];
        truespring_between(g->at, body->rest + i, d);
        if (!(truespring_dot(d, d) <= g->radius * g->radius)) continue;
        body->gripped[q] |= UINT32_C(1) << number;
        g->areas += body->areas[q];
        truespring_between(body->rest + i, body->x + i, d);
        truespring_add(g->begin, body->areas[q], d);
    }
    if (!(g->areas > 0)) return TRUESPRING_NO_SURFACE;
    for (c = 0; c < 3; c++) g->begin[c] /= g->areas;
    memcpy(g->end, g->begin, sizeof g->end);
    memcpy(g->now, g->begin, sizeof g->now);
    g->active = 1;
    return 0;
}

/* Hold the patch of the surface around a point by springs, and move it so that the point is at a place at the end of
 * the next frame or step.
 *
 * number: 0 to TRUESPRING_GRIPS - 1; a grasp that exists is moved, whatever the point, radius and stiffness.
 * point: on the body as it is now [m]: the nearest node of the surface is taken.
 * place: [m]; NULL to hold the patch where it is.
 * radius: distance within which nodes of the surface are held [m]; 0 for body.patch.
 * stiffness: of all springs together [N/m]; 0 for Young's modulus times the radius, in the plane times the thickness.
 * The force of the body on the grasp is body.grip[number].force. */
static inline int truespring_pull(truespring_body *body, int number, const truespring_real *point,
                                  const truespring_real *place, truespring_real radius, truespring_real stiffness)
{
    int error = 0;
    if (number < 0 || number >= TRUESPRING_GRIPS || !point) return TRUESPRING_ARGUMENT;
    if (!isfinite(radius) || !isfinite(stiffness) || radius < 0 || stiffness < 0) return TRUESPRING_ARGUMENT;
    if (!truespring_all_finite(point, 3) || (place && !truespring_all_finite(place, 3))) return TRUESPRING_ARGUMENT;
    if (!body->grip[number].active) error = truespring_grip_at(body, number, point, radius, stiffness);
    if (!error && place) truespring_between(body->grip[number].at, place, body->grip[number].end);
    return error;
}

/* The stiffness of a sphere that does not shorten the step much [Pa/m]. */
static inline truespring_real truespring_contact_stiffness(const truespring_body *body)
{
    truespring_real largest = 0, share;
    uint32_t q;
    for (q = 0; q < body->n_surface; q++) {
        share = body->areas[q] / body->mass[body->surface[q]];
        largest = share > largest ? share : largest;
    }
    return largest > 0 ? 2 / (body->stable_step * body->stable_step) / largest : 0;
}

/* Add a sphere that pushes the surface without friction, or move one to a centre [m] at the end of the next frame.
 * radius [m]: 0 removes the sphere. stiffness: pressure per depth [Pa/m], 0 for that which suits the step.
 * The force of the body on the sphere is body.ball[number].force. */
static inline int truespring_sphere(truespring_body *body, int number, const truespring_real *centre,
                                    truespring_real radius, truespring_real stiffness)
{
    truespring_ball *b;
    if (number < 0 || number >= TRUESPRING_SPHERES || !(radius >= 0) || !(stiffness >= 0)) return TRUESPRING_ARGUMENT;
    b = &body->ball[number];
    if (radius > 0 && (!centre || !truespring_all_finite(centre, 3) || !isfinite(radius) || !isfinite(stiffness)))
        return TRUESPRING_ARGUMENT;
    if (!(radius > 0)) {
        b->active = 0;
        return 0;
    }
    b->radius = radius;
    b->stiffness = stiffness > 0 ? stiffness : truespring_contact_stiffness(body);
    memcpy(b->end, centre, sizeof b->end);
    if (!b->active) {
        memcpy(b->begin, centre, sizeof b->begin);
        memcpy(b->now, centre, sizeof b->now);
    }
    b->active = 1;
    return 0;
}

/* Move grasps and spheres to a share of their way in this frame; at 1 the frame has ended. */
static inline void truespring_move(truespring_body *body, truespring_real share)
{
    int n, c;
    for (n = 0; n < TRUESPRING_GRIPS; n++) {
        truespring_grip *g = &body->grip[n];
        for (c = 0; g->active && c < 3; c++) g->now[c] = g->begin[c] + share * (g->end[c] - g->begin[c]);
        if (g->active && share == 1) memcpy(g->begin, g->end, sizeof g->begin);
    }
    for (n = 0; n < TRUESPRING_SPHERES; n++) {
        truespring_ball *b = &body->ball[n];
        for (c = 0; b->active && c < 3; c++) b->now[c] = b->begin[c] + share * (b->end[c] - b->begin[c]);
        if (b->active && share == 1) memcpy(b->begin, b->end, sizeof b->begin);
    }
}

/* Add the forces of grasps to body.f, and write minus their sum to each grasp; return their energy. */
static inline truespring_real truespring_add_grips(truespring_body *body)
{
    truespring_real energy = 0, d[3], k;
    uint32_t q;
    int n, any = 0, c;
    for (n = 0; n < TRUESPRING_GRIPS; n++) {
        any |= body->grip[n].active;
        memset(body->grip[n].force, 0, sizeof body->grip[n].force);
    }
    for (q = 0; any && q < body->n_surface; q++) {
        size_t i = 3 * (size_t)body->surface[q];
        for (n = 0; body->gripped[q] >> n; n++) {
            truespring_grip *g = &body->grip[n];
            if (!(body->gripped[q] >> n & 1)) {
                if (n == 31) break;
                continue;
            }
            k = g->stiffness * body->areas[q] / g->areas;
            for (c = 0; c < 3; c++) d[c] = body->x[i + c] - body->rest[i + c] - g->now[c];
            truespring_add(body->f + i, -k, d);
            truespring_add(g->force, k, d);
            energy += k / 2 * truespring_dot(d, d);
            if (n == 31) break;
        }
    }
    return energy;
}

/* Add the forces of spheres to body.f, and write minus their sum to each sphere; return their energy. */
static inline truespring_real truespring_add_balls(truespring_body *body)
{
    truespring_real energy = 0, d[3], square, length, size;
    uint32_t q;
    int n;
    for (n = 0; n < TRUESPRING_SPHERES; n++) {
        truespring_ball *b = &body->ball[n];
        memset(b->force, 0, sizeof b->force);
        for (q = 0; b->active && q < body->n_surface; q++) {
            size_t i = 3 * (size_t)body->surface[q];
            truespring_between(b->now, body->x + i, d);
            square = truespring_dot(d, d);
            if (!(square < b->radius * b->radius && square > 0)) continue;
            length = truespring_sqrt(square);
            size = b->stiffness * body->areas[q] * (b->radius - length);
            truespring_add(body->f + i, size / length, d);
            truespring_add(b->force, -size / length, d);
            energy += size / 2 * (b->radius - length);
        }
    }
    return energy;
}

/* --- forces and energies ----------------------------------------------------------------------------------------- */

/* Write loads minus internal forces, with those of grasps and spheres, to body.f. */
static inline void truespring_balance(truespring_body *body)
{
    size_t i, n = 3 * (size_t)body->n_nodes;
    for (i = 0; i < n; i++) body->f[i] = 0;
    (void)truespring_elastic(body, body->x, body->f);
    for (i = 0; i < n; i++) body->f[i] = body->share * body->load[i] - body->f[i];
    (void)truespring_add_grips(body);
    (void)truespring_add_balls(body);
    body->known = 1;
}

/* Write the internal force on each node, the gradient of the energy [N], n_nodes x 3; return the energy [J]. */
static inline truespring_real truespring_force(const truespring_body *body, truespring_real *force)
{
    size_t i;
    for (i = 0; i < 3 * (size_t)body->n_nodes; i++) force[i] = 0;
    return truespring_elastic(body, body->x, force);
}

/* Return the elastic energy [J]. */
static inline truespring_real truespring_energy(truespring_body *body)
{
    return truespring_force(body, body->before);
}

/* Return the kinetic energy [J]. */
static inline truespring_real truespring_kinetic_energy(const truespring_body *body)
{
    truespring_real sum = 0;
    uint32_t i;
    for (i = 0; i < body->n_nodes; i++)
        sum += body->mass[i] / 2 * truespring_dot(body->v + 3 * (size_t)i, body->v + 3 * (size_t)i);
    return sum;
}

/* --- steps ------------------------------------------------------------------------------------------------------- */

/* Place the held directions of a node; return their bits. */
static inline uint32_t truespring_place(truespring_body *body, uint32_t node)
{
    size_t i = 3 * (size_t)node;
    int c;
    for (c = 0; body->held[node] && c < 3; c++)
        if (body->held[node] >> c & 1) body->x[i + c] = body->rest[i + c] + body->share * body->motion[i + c];
    return body->held[node];
}

/* Bring the body back: undeformed and at rest, with a share of the load from now on, without grasps and spheres. */
static inline void truespring_reset(truespring_body *body, truespring_real share)
{
    size_t bytes = 3 * (size_t)body->n_nodes * sizeof(truespring_real);
    uint32_t i;
    int n;
    body->share = share;
    body->time = 0;
    memcpy(body->x, body->rest, bytes);
    memset(body->v, 0, bytes);
    for (i = 0; i < body->n_nodes; i++) (void)truespring_place(body, i);
    for (n = 0; n < TRUESPRING_GRIPS; n++) truespring_release(body, n);
    for (n = 0; n < TRUESPRING_SPHERES; n++) body->ball[n].active = 0;
    truespring_balance(body);
}

/* Bring the body to the equilibrium under the full load that truespring found, at rest. */
static inline int truespring_start(truespring_body *body)
{
    if (!body->equilibrium) return TRUESPRING_NO_EQUILIBRIUM;
    truespring_reset(body, 1);
    memcpy(body->x, body->equilibrium, 3 * (size_t)body->n_nodes * sizeof(truespring_real));
    truespring_balance(body);
    return 0;
}

static inline int truespring_finite(const truespring_body *body)
{
    truespring_real sum = 0;
    size_t i;
    for (i = 0; i < 3 * (size_t)body->n_nodes; i++) sum += body->x[i] - body->x[i]; /* NaN if one is not finite */
    return sum == 0;
}

/* One step of leapfrog of length h, with half a kick at both ends; grasps and spheres are at `share` of their way. */
static inline void truespring_leapfrog(truespring_body *body, truespring_real h, truespring_real share)
{
    truespring_real alpha = body->damping, braked = 1 + h / 2 * alpha;
    uint32_t i, held;
    int c;
    if (!body->known) truespring_balance(body);
    for (i = 0; i < body->n_nodes; i++) {
        truespring_real *x = body->x + 3 * (size_t)i, *v = body->v + 3 * (size_t)i, *f = body->f + 3 * (size_t)i;
        truespring_real before[3];
        memcpy(before, x, sizeof before);
        for (c = 0; c < 3; c++) {
            v[c] += h / 2 * (f[c] / body->mass[i] - alpha * v[c]);
            x[c] += h * v[c];
        }
        held = truespring_place(body, i);
        for (c = 0; held && c < 3; c++)
            if (held >> c & 1) v[c] = (x[c] - before[c]) / h;
    }
    truespring_move(body, share);
    truespring_balance(body);
    for (i = 0; i < body->n_nodes; i++) {
        truespring_real *v = body->v + 3 * (size_t)i, *f = body->f + 3 * (size_t)i;
        for (c = 0; c < 3; c++)
            if (!(body->held[i] >> c & 1)) v[c] = (v[c] + h / 2 * f[c] / body->mass[i]) / braked;
    }
    body->time += (double)h;
}

/* One step of leapfrog (velocity Verlet), of second order: the motion as truespring computes it. dt [s]: at most
 * body.stable_step, better body.step. Grasps and spheres are moved at its end. */
static inline int truespring_step(truespring_body *body, truespring_real dt)
{
    if (!(dt > 0) || !isfinite(dt)) return TRUESPRING_ARGUMENT;
    truespring_leapfrog(body, dt, 1);
    return truespring_finite(body) ? 0 : TRUESPRING_UNSTABLE;
}

/* One step of semi-implicit Euler, of first order: v = (v + dt f/m) / (1 + dt damping), x += dt v. */
static inline int truespring_step_euler(truespring_body *body, truespring_real dt)
{
    uint32_t i, held;
    int c;
    if (!(dt > 0) || !isfinite(dt)) return TRUESPRING_ARGUMENT;
    truespring_move(body, 1);
    truespring_balance(body);
    for (i = 0; i < body->n_nodes; i++) {
        truespring_real *x = body->x + 3 * (size_t)i, *v = body->v + 3 * (size_t)i, *f = body->f + 3 * (size_t)i;
        truespring_real before[3];
        memcpy(before, x, sizeof before);
        for (c = 0; c < 3; c++) {
            v[c] = (v[c] + dt * f[c] / body->mass[i]) / (1 + dt * body->damping);
            x[c] += dt * v[c];
        }
        held = truespring_place(body, i);
        for (c = 0; held && c < 3; c++)
            if (held >> c & 1) v[c] = (x[c] - before[c]) / dt;
    }
    body->known = 0;
    body->time += (double)dt;
    return truespring_finite(body) ? 0 : TRUESPRING_UNSTABLE;
}

/* Return body.step [s], shortened by the stiffness of the present grasps and spheres on the masses of their nodes. */
static inline truespring_real truespring_longest_step(const truespring_body *body)
{
    truespring_real most = 0;
    uint32_t q;
    int n;
    for (q = 0; q < body->n_surface; q++) {
        truespring_real sum = 0;
        for (n = 0; n < TRUESPRING_GRIPS; n++)
            if (body->gripped[q] >> n & 1) sum += body->grip[n].stiffness / body->grip[n].areas;
        for (n = 0; n < TRUESPRING_SPHERES; n++)
            if (body->ball[n].active) sum += body->ball[n].stiffness;
        sum *= body->areas[q] / body->mass[body->surface[q]];
        most = sum > most ? sum : most;
    }
    return 1 / truespring_sqrt(1 / (body->step * body->step) + most);
}

/* Advance by a frame [s] in steps of leapfrog of at most truespring_longest_step; grasps and spheres move evenly
 * through it. Returns the number of steps. */
static inline int truespring_advance(truespring_body *body, truespring_real seconds)
{
    truespring_real wanted = seconds / truespring_longest_step(body);
    int n, s;
    if (!(seconds > 0) || !(wanted < 1000000)) return TRUESPRING_ARGUMENT;
    n = (int)wanted;
    if ((truespring_real)n < wanted * (1 - (truespring_real)1e-6) || n < 1) n++;
    for (s = 1; s <= n; s++)
        truespring_leapfrog(body, seconds / (truespring_real)n, s == n ? 1 : (truespring_real)s / (truespring_real)n);
    return truespring_finite(body) ? n : TRUESPRING_UNSTABLE;
}

/* Sums over the free directions that truespring_settle needs. */
typedef struct {
    truespring_real left, whole;     /* squares of unbalanced forces, and of loads and reactions */
    truespring_real change, inertia; /* v . (forces before - forces), v . M v */
} truespring_sums;

static inline truespring_sums truespring_sum(const truespring_body *body)
{
    truespring_sums sums = {0, 0, 0, 0};
    uint32_t i;
    int c;
    for (i = 0; i < body->n_nodes; i++) {
        for (c = 0; c < 3; c++) {
            size_t at = 3 * (size_t)i + (size_t)c;
            truespring_real f = body->f[at], v = body->v[at], load = body->share * body->load[at];
            if (body->held[i] >> c & 1) {
                sums.whole += f * f;
                continue;
            }
            sums.left += f * f;
            sums.whole += load * load;
            sums.change += v * (body->before[at] - f);
            sums.inertia += body->mass[i] * v * v;
        }
    }
    return sums;
}

/* Bring the body to rest under its loads: dynamic relaxation. Each step is damped critically for the frequency of the
 * motion, which is estimated from the change of the forces (Underwood, Computational Methods for Transient Analysis,
 * 1983), and shortened where that is high. The share of the load grows to 1 in body.ramp steps.
 *
 * tolerance: largest unbalanced force over the loads and reactions, as norms.
 * Returns the number of steps, or TRUESPRING_NOT_SETTLED or TRUESPRING_UNSTABLE. */
static inline int truespring_settle(truespring_body *body, truespring_real tolerance, int most)
{
    truespring_real h = body->step, frequency = 0, fastest, slower;
    size_t bytes = 3 * (size_t)body->n_nodes * sizeof(truespring_real);
    int n, c, error = TRUESPRING_NOT_SETTLED;
    size_t i;
    if (!(tolerance > 0) || most < 1) return TRUESPRING_ARGUMENT;
    memset(body->v, 0, bytes);
    truespring_balance(body);
    for (n = 0; n < most; n++) {
        truespring_sums sums;
        if (body->share < 1) {
            body->share += 1 / (truespring_real)(body->ramp ? body->ramp : 1);
            if (body->share > 1) body->share = 1;
            for (i = 0; i < body->n_nodes; i++) (void)truespring_place(body, (uint32_t)i);
        }
        memcpy(body->before, body->f, bytes);
        truespring_balance(body);
        sums = truespring_sum(body);
        if (!isfinite(sums.left)) error = TRUESPRING_UNSTABLE;
        if (body->share >= 1 && sums.left <= tolerance * tolerance * sums.whole) error = n;
        if (error != TRUESPRING_NOT_SETTLED) break;
        frequency = sums.change > 0 && sums.inertia > 0 ? truespring_sqrt(sums.change / (h * sums.inertia)) : 0;
        h = h + h / 50 < body->step ? h + h / 50 : body->step;
        if (frequency * h > 1) h = 1 / frequency;
        fastest = 0;
        for (i = 0; i < body->n_nodes; i++) {
            truespring_real *v = body->v + 3 * (size_t)i, *f = body->f + 3 * (size_t)i;
            for (c = 0; c < 3; c++)
                v[c] = body->held[i] >> c & 1 ? 0 : (v[c] + h * f[c] / body->mass[i]) / (1 + 2 * h * frequency);
            if (truespring_dot(v, v) > fastest) fastest = truespring_dot(v, v);
        }
        slower = body->patch / 20 / h; /* of no node does a step exceed a small part of an edge */
        slower = fastest > slower * slower ? slower / truespring_sqrt(fastest) : 1;
        for (i = 0; i < 3 * (size_t)body->n_nodes; i++) {
            body->v[i] *= slower;
            body->x[i] += h * body->v[i];
        }
    }
    memset(body->v, 0, bytes);
    truespring_balance(body);
    return error;
}

#endif /* TRUESPRING_H */
