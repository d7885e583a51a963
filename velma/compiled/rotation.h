/* Rotations by rows (9,), vectors (3,), poses as rotation and position (12,). */

#include <math.h>
#include <string.h>

static inline void product(const double *a, const double *b, double *out)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            out[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
}

/* Write a' b. */
static inline void unturned(const double *a, const double *b, double *out)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            out[3 * i + j] = a[i] * b[j] + a[3 + i] * b[3 + j] + a[6 + i] * b[6 + j];
}

static inline void cross(const double *a, const double *b, double *out)
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Write the rotation vector (3,) [rad] of a rotation. */
static inline void logarithm(const double *r, double *out)
{
    double v[3] = {0.5 * (r[7] - r[5]), 0.5 * (r[2] - r[6]), 0.5 * (r[3] - r[1])};
    double s = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]), c = 0.5 * (r[0] + r[4] + r[8] - 1.0);
    double angle = atan2(s, c), axis[3], squared = 0.0;
    if (s > 1e-8 || c > 0.0) {
        for (int i = 0; i < 3; i++)
            out[i] = s > 1e-12 ? v[i] * angle / s : v[i];
        return;
    }
    /* Half a turn: r = 2 u u' - I, the axis u is the longest column of r + I. */
    int k = r[0] >= r[4] ? (r[0] >= r[8] ? 0 : 2) : (r[4] >= r[8] ? 1 : 2);
    for (int i = 0; i < 3; i++) {
        axis[i] = r[3 * i + k] + (i == k);
        squared += axis[i] * axis[i];
    }
    for (int i = 0; i < 3; i++)
        out[i] = 3.14159265358979323846 * axis[i] / sqrt(squared);
}

/* Write what brings a pose to a goal: way (3,) [m] and rotation vector (3,) [rad]. */
static inline void difference(const double *turn, const double *at, const double *goal_turn, const double *goal_at, double *out)
{
    double back[9], left[9];
    for (int i = 0; i < 3; i++) {
        out[i] = goal_at[i] - at[i];
        for (int j = 0; j < 3; j++)
            back[3 * i + j] = turn[3 * j + i];
    }
    product(goal_turn, back, left);
    logarithm(left, out + 3);
}

/* Write the pose of what is placed in another pose. */
static inline void go(const double *pose, const double *placed, double *out)
{
    product(pose, placed, out);
    for (int i = 0; i < 3; i++)
        out[9 + i] = pose[9 + i] + (pose[3 * i] * placed[9] + pose[3 * i + 1] * placed[10] + pose[3 * i + 2] * placed[11]);
}

/* Turn a pose about an axis of its own, of length 1 (Rodrigues). */
static inline void hinge(double *pose, const double *u, double angle)
{
    double s = sin(angle), c = cos(angle), t = 1.0 - c, turn[9];
    double about[9] = {
        t * u[0] * u[0] + c, t * u[0] * u[1] - s * u[2], t * u[0] * u[2] + s * u[1],
        t * u[0] * u[1] + s * u[2], t * u[1] * u[1] + c, t * u[1] * u[2] - s * u[0],
        t * u[0] * u[2] - s * u[1], t * u[1] * u[2] + s * u[0], t * u[2] * u[2] + c,
    };
    product(pose, about, turn);
    memcpy(pose, turn, sizeof turn);
}
