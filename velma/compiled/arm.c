/* All postures of an arm with spherical shoulder, hinge and spherical wrist, in closed form.

   The plain way, whose numbers these are, is ArmGeometry.postures of velma.kinematics.arm. */

#include <math.h>

#include "rotation.h"

typedef struct {
    double upper, fore;     /* shoulder to elbow, elbow to wrist [m] */
    double shoulder[12];    /* in the torso: rotation by rows and position */
} Arm;

typedef struct {
    const double *lower, *upper; /* (7,): limits of the arm [rad] */
    double margin, torso;        /* least distance from them, and largest angle of the torso [rad] */
    int corners, column;         /* of the polygon; the first column of the arm in a posture, whose first is the torso */
    const double *polygon;       /* (corners, 2): where the last two joints may be [rad] */
} Wanted;

enum { COLUMNS = 15, ARM = 7 };

/* Write the angles with Rz(a) Ry(b) Rz(c) = rotation, b of the given sign. */
static void zyz(const double *rotation, double sign, double *angles)
{
    angles[0] = atan2(sign * rotation[5], sign * rotation[2]);
    angles[1] = sign * acos(fmin(fmax(rotation[8], -1.0), 1.0));
    angles[2] = atan2(sign * rotation[7], -sign * rotation[6]);
}

/* Write wrist position and rotation in the shoulder of a torso turned by `angle`; both by rows. */
static void from_shoulder(const Arm *arm, const double *wrist, double angle, double *way, double *goal)
{
    const double *shoulder = arm->shoulder;
    double c = cos(angle), s = sin(angle), turn[9];
    double at[3] = {
        c * wrist[9] + s * wrist[10] - shoulder[9],
        -s * wrist[9] + c * wrist[10] - shoulder[10],
        wrist[11] - shoulder[11],
    };
    for (int j = 0; j < 3; j++) {
        turn[j] = c * wrist[j] + s * wrist[3 + j];
        turn[3 + j] = -s * wrist[j] + c * wrist[3 + j];
        turn[6 + j] = wrist[6 + j];
    }
    unturned(shoulder, turn, goal);
    for (int i = 0; i < 3; i++)
        way[i] = shoulder[i] * at[0] + shoulder[3 + i] * at[1] + shoulder[6 + i] * at[2];
}

/* Write the directions of upper arm and forearm in the shoulder; return the elbow's angle, positive. */
static double elbow(const Arm *arm, const double *way, double reach, double swivel, double *upper_axis, double *fore_axis)
{
    double a = arm->upper, b = arm->fore, along[3] = {way[0] / reach, way[1] / reach, way[2] / reach}, across[3];
    double side[3] = {along[1], -along[0], 0.0}, thick = hypot(side[0], side[1]);
    side[0] = thick < 1e-6 ? 1.0 : side[0] / thick; /* wrist straight above the shoulder: any reference will do */
    side[1] = thick < 1e-6 ? 0.0 : side[1] / thick;
    cross(along, side, across);
    double cosine = (a * a + reach * reach - b * b) / (2.0 * a * reach), sine = sqrt(1.0 - cosine * cosine);
    for (int i = 0; i < 3; i++) {
        upper_axis[i] = cosine * along[i] + sine * (cos(swivel) * side[i] + sin(swivel) * across[i]);
        fore_axis[i] = (way[i] - a * upper_axis[i]) / b;
    }
    return acos((reach * reach - a * a - b * b) / (2.0 * a * b));
}

/* Write both postures (8,) of the shoulder with both of the wrist, for an elbow at q3, after the torso's angle. */
static void branches(const double *upper_axis, const double *fore_axis, double q3, const double *goal, double torso, double *q)
{
    double x[3], y[3], turned[3], hand[9];
    for (int i = 0; i < 3; i++)
        x[i] = (cos(q3) * upper_axis[i] - fore_axis[i]) / sin(q3);
    cross(upper_axis, x, y);
    cross(y, fore_axis, turned);
    double upper[9], fore[9];
    for (int i = 0; i < 3; i++) {
        double above[3] = {x[i], y[i], upper_axis[i]}, below[3] = {turned[i], y[i], fore_axis[i]};
        for (int j = 0; j < 3; j++) {
            upper[3 * i + j] = above[j];
            fore[3 * i + j] = below[j];
        }
    }
    unturned(fore, goal, hand);
    for (int k = 0; k < 4; k++, q += 8) {
        q[0] = torso;
        zyz(upper, k < 2 ? 1.0 : -1.0, q + 1);
        q[4] = q3;
        zyz(hand, k % 2 ? -1.0 : 1.0, q + 5);
    }
}

/* Write the postures, torso + arm (8, 8), with the wrist (12,) where it is in the world's torso, for a torso and a swivel.
   Return how many: none where the wrist is out of reach. */
static int postures(const Arm *arm, const double *wrist, double torso, double swivel, double *found)
{
    double way[3], goal[9], upper_axis[3], fore_axis[3];
    from_shoulder(arm, wrist, torso, way, goal);
    double reach = sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2]);
    if (!(reach < arm->upper + arm->fore - 1e-6 && reach > fabs(arm->upper - arm->fore) + 1e-6)) /* nor NaN */
        return 0;
    double q3 = elbow(arm, way, reach, swivel, upper_axis, fore_axis);
    branches(upper_axis, fore_axis, q3, goal, torso, found);
    branches(upper_axis, fore_axis, -q3, goal, torso, found + 8 * 4);
    return 8;
}

/* Whether a point is inside the polygon: an odd number of edges is to the right of it. */
static int inside(const Wanted *wanted, double x, double y)
{
    int right = 0;
    for (int k = 0; k < wanted->corners; k++) {
        const double *from = wanted->polygon + 2 * k, *to = wanted->polygon + 2 * ((k + 1) % wanted->corners);
        if ((from[1] > y) != (to[1] > y))
            right += x < (to[0] - from[0]) * (y - from[1]) / (to[1] - from[1]) + from[0];
    }
    return right % 2;
}

/* Whether a motion may end at torso + arm (8,). */
static int comfortable(const Wanted *wanted, const double *q)
{
    if (!(fabs(q[0]) <= wanted->torso))
        return 0;
    for (int i = 0; i < ARM; i++)
        if (!(q[1 + i] - wanted->lower[i] >= wanted->margin && wanted->upper[i] - q[1 + i] >= wanted->margin))
            return 0;
    return inside(wanted, q[ARM - 1], q[ARM]);
}

/* Write the postures (8 n, 15) at most in which a motion may end, for n pairs of torso and swivel, else as q (15,). */
int arm_comfortable(const Arm *arm, const Wanted *wanted, const double *wrist, int n, const double *torso, const double *swivel,
                    const double *q, double *found)
{
    int count = 0;
    double some[8][ARM + 1];
    for (int k = 0; k < n; k++) {
        int solved = postures(arm, wrist, torso[k], swivel[k], some[0]);
        for (int i = 0; i < solved; i++) {
            if (!comfortable(wanted, some[i]))
                continue;
            double *posture = found + COLUMNS * count++;
            memcpy(posture, q, COLUMNS * sizeof *q);
            posture[0] = some[i][0];
            memcpy(posture + wanted->column, some[i] + 1, ARM * sizeof *q);
        }
    }
    return count;
}
