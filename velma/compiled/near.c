/* Whether a posture is free of contact: where the shapes are then, and which pairs of them are nearer than a margin.

   Boxes along the world's axes around each shape, and around the shapes of each body, are compared first. Spheres and boxes
   are then compared as they are, other shapes by the box around them; what that does not decide is left to coal. The plain
   way is velma.kinematics.collision.World without a library. */

#include "rotation.h"

enum kind { OTHER, SPHERE, BOX };
enum { COLUMNS = 15, APART = -2, TOUCHES = -1 }; /* columns of a posture; verdicts beside a number of pairs left */

typedef struct {
    int joints, shapes, bodies;
    const int *parent;          /* (joints,): of earlier joints; -1 the world */
    const double *placed;       /* (joints, 12): in the parent */
    const double *axis;         /* (joints, 3): of length 1 */
    const int *column;          /* (15,): the joint of each column of a posture */
    double *angle;              /* (joints,) [rad]: of joints that are in no posture, too */
    double *used, *joint;       /* (joints,), (joints, 12): the angles that were used last (NaN: none), and poses by them */
    const int *on;              /* (shapes,): the joint that a shape is fixed to; -1 the world */
    const double *mounted;      /* (shapes, 12): where, as pose in the joint */
    unsigned char *moved;       /* (shapes,): whether that has changed */
    double *at;                 /* (shapes, 12): pose in the world */
    const double *half;         /* (shapes, 3): half edges of the box around a shape in its own frame [m] */
    const unsigned char *kind;  /* (shapes,): of enum kind */
    const int *body;            /* (shapes,): the body that a shape belongs to */
    double *box, *body_box;     /* (shapes, 6), (bodies, 6): least and largest x, y, z */
} Near;

typedef struct {
    int pairs, body_pairs;
    const int *first_body, *second_body; /* (body_pairs,) */
    const int *start;           /* (body_pairs + 1,): where the pairs of shapes of a pair of bodies begin */
    const int *first, *second, *number;  /* (pairs,): two shapes, and the number of their pair */
    int *found;                 /* (pairs + body_pairs + 1,) */
} Among;

/* More than rounding errors of a position of some metres [m]. */
static const double ROUNDING = 1e-9;
/* Edges turned by less [rad] are parallel; boxes that overlap by more [m] along each axis meet. */
static const double PARALLEL = 1e-6, SURELY = 1e-5;

/* Of numbers that are not NaN; fmin and fmax of C are calls, which takes a third of a check. */
static inline double smaller(double a, double b) { return a < b ? a : b; }
static inline double larger(double a, double b) { return a > b ? a : b; }

/* Place the joints that have turned and the shapes on them; whether all angles are finite. */
static int place(const Near *near, const double *q)
{
    static const double WORLD[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    unsigned char turned[64];
    for (int k = 0; k < COLUMNS; k++) {
        if (!isfinite(q[k]))
            return 0;
        near->angle[near->column[k]] = q[k];
    }
    for (int k = 0; k < near->joints; k++) {
        int parent = near->parent[k];
        turned[k] = near->angle[k] != near->used[k] || (parent >= 0 && turned[parent]);
        if (!turned[k])
            continue;
        go(parent < 0 ? WORLD : near->joint + 12 * parent, near->placed + 12 * k, near->joint + 12 * k);
        hinge(near->joint + 12 * k, near->axis + 3 * k, near->angle[k]);
        near->used[k] = near->angle[k];
    }
    for (int i = 0; i < near->shapes; i++) {
        int on = near->on[i];
        if (!near->moved[i] && (on < 0 || !turned[on]))
            continue;
        go(on < 0 ? WORLD : near->joint + 12 * on, near->mounted + 12 * i, near->at + 12 * i);
        near->moved[i] = 0;
    }
    return 1;
}

static void boxes(const Near *near, double margin)
{
    for (int k = 0; k < 6 * near->bodies; k++)
        near->body_box[k] = k % 6 < 3 ? INFINITY : -INFINITY;
    for (int i = 0; i < near->shapes; i++) {
        const double *at = near->at + 12 * i, *half = near->half + 3 * i;
        double *box = near->box + 6 * i, *whole = near->body_box + 6 * near->body[i];
        for (int a = 0; a < 3; a++) {
            double reach = fabs(at[3 * a]) * half[0] + fabs(at[3 * a + 1]) * half[1] + fabs(at[3 * a + 2]) * half[2];
            double wide = reach + 0.5 * margin + ROUNDING;
            box[a] = at[9 + a] - wide;
            box[3 + a] = at[9 + a] + wide;
            whole[a] = smaller(whole[a], box[a]);
            whole[3 + a] = larger(whole[3 + a], box[3 + a]);
        }
    }
}

/* Without branches: which of the six differ cannot be foreseen, and a wrong guess costs more than all six. */
static int meet(const double *a, const double *b)
{
    return (a[0] <= b[3]) & (b[0] <= a[3]) & (a[1] <= b[4]) & (b[1] <= a[4]) & (a[2] <= b[5]) & (b[2] <= a[5]);
}

/* Write the places of the pairs of shapes whose boxes meet to `found`, behind those of bodies; return where, and how many. */
static int *meeting(const Near *near, const Among *among, double margin, int *count)
{
    int bodies = 0, *found = among->found;
    boxes(near, margin);
    for (int k = 0; k < among->body_pairs; k++) {
        found[bodies] = k;
        bodies += meet(near->body_box + 6 * among->first_body[k], near->body_box + 6 * among->second_body[k]);
    }
    int *close = found + bodies;
    *count = 0;
    for (int n = 0; n < bodies; n++)
        for (int k = among->start[found[n]]; k < among->start[found[n] + 1]; k++) {
            close[*count] = k;
            *count += meet(near->box + 6 * among->first[k], near->box + 6 * among->second[k]);
        }
    return close;
}

/* Square of the distance [m2] from the centre of a sphere to a sphere's centre, or to the box of another shape. */
static double apart(const Near *near, int sphere, int other)
{
    const double *from = near->at + 12 * other, *half = near->half + 3 * other, *centre = near->at + 12 * sphere + 9;
    double way[3] = {centre[0] - from[9], centre[1] - from[10], centre[2] - from[11]}, sum = 0.0;
    for (int a = 0; a < 3; a++) {
        double along = way[0] * from[a] + way[1] * from[3 + a] + way[2] * from[6 + a];
        double out = near->kind[other] == SPHERE ? along : larger(fabs(along) - half[a], 0.0);
        sum += out * out;
    }
    return sum;
}

/* The largest gap [m] between two boxes along one of the 15 axes that can part them, or one that is larger than `enough`:
   they are at least so far apart. A negative one is an overlap along each axis: they meet. */
static double gap(const Near *near, int first, int second, double enough)
{
    const double *a = near->at + 12 * first, *b = near->at + 12 * second;
    const double *size = near->half + 3 * first, *other = near->half + 3 * second;
    double turn[9], along[9], way[3] = {b[9] - a[9], b[10] - a[10], b[11] - a[11]}, t[3], most = -INFINITY;
    unturned(a, b, turn);
    for (int k = 0; k < 9; k++)
        along[k] = fabs(turn[k]);
    for (int i = 0; i < 3; i++) {
        t[i] = way[0] * a[i] + way[1] * a[3 + i] + way[2] * a[6 + i];
        double reach = along[3 * i] * other[0] + along[3 * i + 1] * other[1] + along[3 * i + 2] * other[2];
        most = larger(most, fabs(t[i]) - size[i] - reach);
    }
    for (int j = 0; j < 3 && most <= enough; j++) {
        double reach = along[j] * size[0] + along[3 + j] * size[1] + along[6 + j] * size[2];
        most = larger(most, fabs(way[0] * b[j] + way[1] * b[3 + j] + way[2] * b[6 + j]) - other[j] - reach);
    }
    for (int i = 0; i < 3 && most <= enough; i++)
        for (int j = 0; j < 3; j++) {
            int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            double length = sqrt(larger(1.0 - turn[3 * i + j] * turn[3 * i + j], 0.0));
            if (length < PARALLEL) /* the axes above part what this one would, but for less than SURELY */
                continue;
            double reach = size[i1] * along[3 * i2 + j] + size[i2] * along[3 * i1 + j]
                         + other[j1] * along[3 * i + j2] + other[j2] * along[3 * i + j1];
            most = larger(most, (fabs(t[i2] * turn[3 * i1 + j] - t[i1] * turn[3 * i2 + j]) - reach) / length);
        }
    return most;
}

/* Whether two shapes are nearer than the margin: TOUCHES, APART, or 1 for what only an exact check can tell. */
static int verdict(const Near *near, int first, int second, double margin)
{
    int sphere = near->kind[first] == SPHERE ? first : second, other = sphere == first ? second : first;
    if (near->kind[sphere] == SPHERE) {
        double least = near->half[3 * sphere] + margin + (near->kind[other] == SPHERE ? near->half[3 * other] : 0.0);
        if (near->kind[other] != OTHER)
            return apart(near, sphere, other) <= least * least ? TOUCHES : APART;
        least += ROUNDING;
        return apart(near, sphere, other) <= least * least ? 1 : APART;
    }
    double between = gap(near, first, second, margin + ROUNDING);
    if (between > margin + ROUNDING)
        return APART;
    return near->kind[first] == BOX && near->kind[second] == BOX && between < -SURELY ? TOUCHES : 1;
}

/* Write the numbers of the pairs that only an exact check can tell to `found` and return how many; TOUCHES if a pair does. */
static int undecided(const Near *near, const Among *among, double margin)
{
    int count, left = 0, *close = meeting(near, among, margin, &count);
    for (int n = 0; n < count; n++) {
        int k = close[n], found = verdict(near, among->first[k], among->second[k], margin);
        if (found == TOUCHES)
            return TOUCHES;
        if (found != APART)
            among->found[left++] = among->number[k];
    }
    return left;
}

/* Go through postures (n, 15) to the first one in which nothing surely touches, or with `all`, in which not all is surely
   apart, and return its number; n if there is none. The shapes are placed as there. The number of pairs that only an exact
   check can tell, TOUCHES, or APART where an angle is not finite is written to `left`, the pairs to `found`. */
int near_first(const Near *near, const Among *among, double margin, const double *q, int n, int all, int *left)
{
    for (int k = 0; k < n; k++) {
        *left = place(near, q + COLUMNS * k) ? undecided(near, among, margin) : APART;
        if (all ? *left != 0 : *left >= 0)
            return k;
    }
    return n;
}

/* Place the shapes; write the numbers of the pairs that may be nearer than the margin to `found` and return how many. */
int near_pairs(const Near *near, const Among *among, double margin, const double *q)
{
    if (!place(near, q))
        return 0;
    int count, *close = meeting(near, among, margin, &count);
    for (int n = 0; n < count; n++)
        among->found[n] = among->number[close[n]];
    return count;
}
