/* Which pairs of the collision world may be nearer than a margin: a cull before coal's exact check.

   Boxes along the world's axes around each shape, and around the shapes of each body, are compared; pairs of spheres and
   of a sphere and a box are decided here. The plain way is velma.kinematics.collision.World without a library. */

#include <math.h>

typedef struct {
    int shapes, bodies, pairs, body_pairs;
    const double *at;           /* (shapes, 12): rotation by columns, then position [m], as Pinocchio keeps them */
    const double *half;         /* (shapes, 3): half edges of the box around a shape in its own frame [m] */
    const unsigned char *kind;  /* (shapes,): of enum kind */
    const int *body;            /* (shapes,): the body that a shape belongs to */
    double *box, *body_box;     /* (shapes, 6), (bodies, 6): least and largest x, y, z */
    const int *first_body, *second_body; /* (body_pairs,) */
    const int *start;           /* (body_pairs + 1,): where the pairs of shapes of a pair of bodies begin */
    const int *first, *second, *number;  /* (pairs,): two shapes, and their number among Pinocchio's pairs */
    int *found;                 /* (pairs + body_pairs + 1,) */
} Near;

enum kind { OTHER, SPHERE, BOX };

/* More than rounding errors of a position of some metres [m]. */
static const double ROUNDING = 1e-9;

static void boxes(const Near *near, double margin)
{
    for (int k = 0; k < 6 * near->bodies; k++)
        near->body_box[k] = k % 6 < 3 ? INFINITY : -INFINITY;
    for (int i = 0; i < near->shapes; i++) {
        const double *at = near->at + 12 * i, *half = near->half + 3 * i;
        double *box = near->box + 6 * i, *whole = near->body_box + 6 * near->body[i];
        for (int a = 0; a < 3; a++) {
            double reach = fabs(at[a]) * half[0] + fabs(at[3 + a]) * half[1] + fabs(at[6 + a]) * half[2];
            double wide = reach + 0.5 * margin + ROUNDING;
            box[a] = at[9 + a] - wide;
            box[3 + a] = at[9 + a] + wide;
            whole[a] = fmin(whole[a], box[a]);
            whole[3 + a] = fmax(whole[3 + a], box[3 + a]);
        }
    }
}

/* Without branches: which of the six differ cannot be foreseen, and a wrong guess costs more than all six. */
static int meet(const double *a, const double *b)
{
    return (a[0] <= b[3]) & (b[0] <= a[3]) & (a[1] <= b[4]) & (b[1] <= a[4]) & (a[2] <= b[5]) & (b[2] <= a[5]);
}

/* Square of the distance [m2] from the centre of sphere s to the box b, or to the sphere b's centre. */
static double apart(const Near *near, int s, int b)
{
    const double *from = near->at + 12 * b, *half = near->half + 3 * b, *centre = near->at + 12 * s + 9;
    double way[3] = {centre[0] - from[9], centre[1] - from[10], centre[2] - from[11]}, sum = 0.0;
    for (int a = 0; a < 3; a++) {
        double along = way[0] * from[3 * a] + way[1] * from[3 * a + 1] + way[2] * from[3 * a + 2];
        double out = near->kind[b] == BOX ? fmax(fabs(along) - half[a], 0.0) : along;
        sum += out * out;
    }
    return sum;
}

/* Whether a sphere and a sphere or a box come nearer than the margin. */
static int touches(const Near *near, int s, int b, double margin)
{
    double least = near->half[3 * s] + margin + (near->kind[b] == SPHERE ? near->half[3 * b] : 0.0);
    return apart(near, s, b) <= least * least;
}

/* Write the numbers of the pairs to be checked exactly to `found` and return how many; -1 if a pair touches anyway. */
int near_pairs(const Near *near, double margin)
{
    int bodies = 0, count = 0, *found = near->found;
    boxes(near, margin);
    for (int k = 0; k < near->body_pairs; k++) {
        found[bodies] = k;
        bodies += meet(near->body_box + 6 * near->first_body[k], near->body_box + 6 * near->second_body[k]);
    }
    int *close = found + bodies;
    for (int n = 0; n < bodies; n++)
        for (int k = near->start[found[n]]; k < near->start[found[n] + 1]; k++) {
            close[count] = k;
            count += meet(near->box + 6 * near->first[k], near->box + 6 * near->second[k]);
        }
    int left = 0;
    for (int n = 0; n < count; n++) {
        int k = close[n], i = near->first[k], j = near->second[k];
        int s = near->kind[i] == SPHERE ? i : j, b = s == i ? j : i;
        if (near->kind[s] != SPHERE || near->kind[b] == OTHER)
            found[left++] = near->number[k];
        else if (touches(near, s, b, margin))
            return -1;
    }
    return left;
}
