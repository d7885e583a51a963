/* A chain of hinges: where its end is, and the joints that bring the end to a pose.

   The plain ways, whose numbers these are, are Robot.track and velma.kinematics.ik.solve, by Pinocchio. */

#include <math.h>
#include <string.h>

#include "cholesky.h"
#include "rotation.h"

enum { MOST = 16, ALL = 15 }; /* joints of a chain at most (velma.kinematics.chain looks); columns of a posture */

typedef struct {
    int joints;
    const double *placed; /* (joints + 1, 12): each joint in the one before, rotation by rows and position; the end */
    const double *axis;   /* (joints, 3): of length 1 */
    const int *column;    /* (joints,): of a posture */
} Chain;

typedef struct {
    int iterations;
    double near, turned;                         /* tolerances of each axis [m], [rad] */
    double damping, largest_turn, largest_error; /* as in velma.kinematics.ik */
    const double *lower, *upper;                 /* (15,) */
    const unsigned char *moves;                  /* (15,): whether a column may move */
} Limits;

typedef struct {
    double turn[9], at[3];
} Pose;

static void cross(const double *a, const double *b, double *out)
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Go from a pose to the one placed in it (12,). */
static void go(Pose *pose, const double *placed)
{
    double turn[9];
    for (int i = 0; i < 3; i++)
        pose->at[i] += pose->turn[3 * i] * placed[9] + pose->turn[3 * i + 1] * placed[10] + pose->turn[3 * i + 2] * placed[11];
    product(pose->turn, placed, turn);
    memcpy(pose->turn, turn, sizeof turn);
}

/* Turn a pose about an axis of its own (Rodrigues). */
static void hinge(Pose *pose, const double *u, double angle)
{
    double s = sin(angle), c = cos(angle), t = 1.0 - c, turn[9];
    double about[9] = {
        t * u[0] * u[0] + c, t * u[0] * u[1] - s * u[2], t * u[0] * u[2] + s * u[1],
        t * u[0] * u[1] + s * u[2], t * u[1] * u[1] + c, t * u[1] * u[2] - s * u[0],
        t * u[0] * u[2] - s * u[1], t * u[1] * u[2] + s * u[0], t * u[2] * u[2] + c,
    };
    product(pose->turn, about, turn);
    memcpy(pose->turn, turn, sizeof turn);
}

/* Pose of the end at a posture; if asked for, position and axis of each joint in the world (joints, 3). */
static Pose end(const Chain *chain, const double *q, double (*at)[3], double (*axis)[3])
{
    Pose pose = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}};
    for (int k = 0; k < chain->joints; k++) {
        const double *u = chain->axis + 3 * k;
        go(&pose, chain->placed + 12 * k);
        for (int i = 0; at && i < 3; i++) {
            at[k][i] = pose.at[i];
            axis[k][i] = pose.turn[3 * i] * u[0] + pose.turn[3 * i + 1] * u[1] + pose.turn[3 * i + 2] * u[2];
        }
        hinge(&pose, u, q[chain->column[k]]);
    }
    go(&pose, chain->placed + 12 * chain->joints);
    return pose;
}

/* Write the positions (n, 3) of the end at postures (n, 15). */
void chain_track(const Chain *chain, const double *q, int n, double *places)
{
    for (int k = 0; k < n; k++) {
        Pose pose = end(chain, q + ALL * k, 0, 0);
        memcpy(places + 3 * k, pose.at, sizeof pose.at);
    }
}

/* What brings the end to the target: way [m] and rotation vector [rad]. */
static int error_of(const Pose *here, const double *target, const Limits *limits, double *error)
{
    int there = 1;
    difference(here->turn, here->at, target, target + 9, error);
    for (int i = 0; i < 3; i++) {
        there &= fabs(error[i]) < limits->near; /* NaN is not */
        there &= fabs(error[3 + i]) < limits->turned;
    }
    return there;
}

/* One step of damped least squares, none larger than allowed, inside the limits. */
static void step(const Chain *chain, const Limits *limits, const Pose *here, double (*at)[3], double (*axis)[3],
                 double *error, double *q)
{
    double columns[MOST][6], square[6][6] = {{0}}, change[MOST], largest = 0.0;
    int count = 0, moving[MOST];
    for (int k = 0; k < chain->joints; k++) {
        if (!limits->moves[chain->column[k]])
            continue;
        double way[3] = {here->at[0] - at[k][0], here->at[1] - at[k][1], here->at[2] - at[k][2]};
        cross(axis[k], way, columns[count]);
        memcpy(columns[count] + 3, axis[k], sizeof axis[k]);
        for (int i = 0; i < 6; i++)
            for (int j = 0; j < 6; j++)
                square[i][j] += columns[count][i] * columns[count][j];
        moving[count++] = chain->column[k];
    }
    for (int i = 0; i < 6; i++) {
        square[i][i] += limits->damping;
        error[i] = fmin(fmax(error[i], -limits->largest_error), limits->largest_error);
    }
    factor(square[0], 6); /* damping makes it positive definite */
    substitute(square[0], 6, error);
    for (int k = 0; k < count; k++) {
        change[k] = 0.0;
        for (int i = 0; i < 6; i++)
            change[k] += columns[k][i] * error[i];
        largest = fmax(largest, fabs(change[k]));
    }
    double share = largest <= limits->largest_turn ? 1.0 : limits->largest_turn / largest;
    for (int k = 0; k < count; k++) {
        int c = moving[k];
        q[c] = fmin(fmax(q[c] + share * change[k], limits->lower[c]), limits->upper[c]);
    }
}

/* Move the posture (15,) until its end is at the target (12,); whether it got there. */
int chain_solve(const Chain *chain, const Limits *limits, const double *target, double *q)
{
    double at[MOST][3], axis[MOST][3], error[6];
    for (int k = 0; k < limits->iterations; k++) {
        Pose here = end(chain, q, at, axis);
        if (error_of(&here, target, limits, error))
            return 1;
        step(chain, limits, &here, at, axis, error, q);
    }
    return 0;
}
