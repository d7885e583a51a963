/* A chain of hinges: where its end is, and the joints that bring the end to a pose.

   The plain ways, whose numbers these are, are Robot.track and velma.kinematics.ik.solve, by Pinocchio. */

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

/* Write the pose of the end at a posture; if asked for, position and axis of each joint in the world (joints, 3). */
static void end(const Chain *chain, const double *q, double (*at)[3], double (*axis)[3], double *pose)
{
    double last[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    for (int k = 0; k < chain->joints; k++) {
        const double *u = chain->axis + 3 * k;
        go(last, chain->placed + 12 * k, pose);
        for (int i = 0; at && i < 3; i++) {
            at[k][i] = pose[9 + i];
            axis[k][i] = pose[3 * i] * u[0] + pose[3 * i + 1] * u[1] + pose[3 * i + 2] * u[2];
        }
        hinge(pose, u, q[chain->column[k]]);
        memcpy(last, pose, sizeof last);
    }
    go(last, chain->placed + 12 * chain->joints, pose);
}

/* Write the positions (n, 3) of the end at postures (n, 15). */
void chain_track(const Chain *chain, const double *q, int n, double *places)
{
    double pose[12];
    for (int k = 0; k < n; k++) {
        end(chain, q + ALL * k, 0, 0, pose);
        memcpy(places + 3 * k, pose + 9, 3 * sizeof *pose);
    }
}

/* Write the upward parts (n,) of a direction (3,) fixed to the end, at postures (n, 15). */
void chain_upward(const Chain *chain, const double *q, int n, const double *direction, double *parts)
{
    double pose[12];
    for (int k = 0; k < n; k++) {
        end(chain, q + ALL * k, 0, 0, pose);
        parts[k] = pose[6] * direction[0] + pose[7] * direction[1] + pose[8] * direction[2];
    }
}

/* Write the time [s] of each step of a path (n, columns) of some columns of a posture, which else is as q (15,): what the end
   needs at `tool` [m/s], or a column at its speed (columns,) [rad/s]. */
void chain_times(const Chain *chain, const double *q, const double *path, int n, int columns, const int *column, double tool,
                 const double *speed, double *times)
{
    double posture[ALL], pose[12], before[3];
    memcpy(posture, q, sizeof posture);
    for (int k = 0; k < n; k++) {
        const double *here = path + columns * k, *last = here - columns;
        double most = 0.0, squared = 0.0;
        for (int j = 0; j < columns; j++)
            posture[column[j]] = here[j];
        end(chain, posture, 0, 0, pose);
        for (int j = 0; k && j < columns; j++)
            most = fmax(most, fabs(here[j] - last[j]) / speed[j]);
        for (int i = 0; k && i < 3; i++)
            squared += (pose[9 + i] - before[i]) * (pose[9 + i] - before[i]);
        if (k)
            times[k - 1] = fmax(most, sqrt(squared) / tool);
        memcpy(before, pose + 9, sizeof before);
    }
}

/* What brings the end to the target: way [m] and rotation vector [rad]. */
static int error_of(const double *here, const double *target, const Limits *limits, double *error)
{
    int there = 1;
    difference(here, here + 9, target, target + 9, error);
    for (int i = 0; i < 3; i++) {
        there &= fabs(error[i]) < limits->near; /* NaN is not */
        there &= fabs(error[3 + i]) < limits->turned;
    }
    return there;
}

/* One step of damped least squares, none larger than allowed, inside the limits. */
static void step(const Chain *chain, const Limits *limits, const double *here, double (*at)[3], double (*axis)[3],
                 double *error, double *q)
{
    double columns[MOST][6], square[6][6] = {{0}}, change[MOST], largest = 0.0;
    int count = 0, moving[MOST];
    for (int k = 0; k < chain->joints; k++) {
        if (!limits->moves[chain->column[k]])
            continue;
        double way[3] = {here[9] - at[k][0], here[10] - at[k][1], here[11] - at[k][2]};
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
    double at[MOST][3], axis[MOST][3], error[6], here[12];
    for (int k = 0; k < limits->iterations; k++) {
        end(chain, q, at, axis, here);
        if (error_of(here, target, limits, error))
            return 1;
        step(chain, limits, here, at, axis, error, q);
    }
    return 0;
}

/* Write the pose that a share of a turn (3,) [rad] and way (3,) [m] leads to from a pose; none may be another's memory. */
static void between(const double *from, const double *turn, const double *way, double share, double *pose)
{
    double angle = sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]);
    double about[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, axis[3] = {0, 0, 1};
    for (int i = 0; i < 3; i++) {
        pose[9 + i] = from[9 + i] + share * way[i];
        axis[i] = angle > 0.0 ? turn[i] / angle : axis[i];
    }
    hinge(about, axis, share * angle);
    product(about, from, pose);
}

/* Write postures (n, 15) near q (15,) and each other whose ends go straight from `from` (12,) to `to` (12,), from excluded.
   Return how many: fewer than n where one is not found. The last one is farther than `jump` [rad] from the one before in
   some joint, or all are nearer; `jumps` tells. */
int chain_line(const Chain *chain, const Limits *limits, const double *from, const double *to, int n, double jump,
               const double *q, double *path, int *jumps)
{
    double apart[6], target[12];
    difference(from, from + 9, to, to + 9, apart);
    *jumps = 0;
    for (int k = 0; k < n; k++) {
        double *here = path + ALL * k;
        const double *last = k ? here - ALL : q;
        memcpy(here, last, ALL * sizeof *here);
        between(from, apart + 3, apart, (k + 1.0) / n, target);
        if (!chain_solve(chain, limits, target, here))
            return k;
        for (int i = 0; i < ALL; i++)
            *jumps |= fabs(here[i] - last[i]) > jump;
        if (*jumps)
            return k + 1;
    }
    return n;
}
