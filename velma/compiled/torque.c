/* The torque law of both hands in one call. The plain way, whose numbers these are, is velma.control.cartesian. */

#include <string.h>

#include "cholesky.h"

enum { JOINTS = 15, TASK = 12, HAND = 6, SWEEPS = 30 }; /* sweeps at most: an estimate, so that it ends */

typedef struct {
    /* read */
    double mass[JOINTS][JOINTS], jacobian[TASK][JOINTS];
    double error[TASK], slip[JOINTS], stray[JOINTS], wrench[TASK];
    double stiffness[TASK], posture_stiffness[JOINTS], posture_damping[JOINTS];
    double regularisation, twice_ratio;
    /* written, the damping at times by its caller */
    double damping[TASK][TASK], inertia[TASK][TASK], through[TASK][JOINTS], torque[JOINTS];
} Law;

/* Write J M^-1 and Lam = (J M^-1 J' + regularisation)^-1; 0 if a matrix is not positive definite. */
int law_inertia(Law *law)
{
    double lower[JOINTS][JOINTS], mobility[TASK][TASK];
    memcpy(lower, law->mass, sizeof lower);
    if (!factor(lower[0], JOINTS))
        return 0;
    memcpy(law->through, law->jacobian, sizeof law->through);
    for (int i = 0; i < TASK; i++)
        substitute(lower[0], JOINTS, law->through[i]);
    for (int i = 0; i < TASK; i++)
        for (int j = 0; j <= i; j++) {
            double sum = i == j ? law->regularisation : 0.0;
            for (int k = 0; k < JOINTS; k++)
                sum += law->through[i][k] * law->jacobian[j][k];
            mobility[i][j] = sum;
        }
    if (!factor(mobility[0], TASK))
        return 0;
    for (int i = 0; i < TASK; i++) {
        memset(law->inertia[i], 0, sizeof law->inertia[i]);
        law->inertia[i][i] = 1.0;
        substitute(mobility[0], TASK, law->inertia[i]);
    }
    return 1;
}

/* Turn the symmetric a (6, 6) into a diagonal by Jacobi's rotations, and the columns of v (6, 6) with it. */
static void diagonal(double a[HAND][HAND], double v[HAND][HAND])
{
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        double off = 0.0, on = 0.0;
        for (int i = 0; i < HAND; i++) {
            on += a[i][i] * a[i][i];
            for (int j = 0; j < i; j++)
                off += a[i][j] * a[i][j];
        }
        if (!(off > 1e-32 * on)) /* to rounding, squared */
            return;
        for (int p = 0; p < HAND; p++)
            for (int q = p + 1; q < HAND; q++) {
                if (a[p][q] == 0.0)
                    continue;
                double theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                double t = (theta >= 0.0 ? 1.0 : -1.0) / (fabs(theta) + sqrt(theta * theta + 1.0));
                double c = 1.0 / sqrt(t * t + 1.0), s = t * c;
                for (int k = 0; k < HAND; k++) {
                    double kp = a[k][p], kq = a[k][q];
                    a[k][p] = c * kp - s * kq;
                    a[k][q] = s * kp + c * kq;
                }
                for (int k = 0; k < HAND; k++) {
                    double pk = a[p][k], qk = a[q][k], vp = v[k][p], vq = v[k][q];
                    a[p][k] = c * pk - s * qk;
                    a[q][k] = s * pk + c * qk;
                    v[k][p] = c * vp - s * vq;
                    v[k][q] = s * vp + c * vq;
                }
            }
    }
}

/* Write the block of D that belongs to a hand: its own block of Lam is damped. 0 if that is not positive definite. */
static int damp(Law *law, int at)
{
    double lower[HAND][HAND], columns[HAND][HAND] = {{0.0}}, turned[HAND][HAND], modes[HAND][HAND] = {{0.0}}, q[HAND][HAND];
    for (int i = 0; i < HAND; i++)
        for (int j = 0; j < HAND; j++)
            lower[i][j] = j > i ? 0.0 : law->inertia[at + i][at + j];
    if (!factor(lower[0], HAND))
        return 0;
    for (int j = 0; j < HAND; j++) {
        columns[j][j] = 1.0;
        forward(lower[0], HAND, columns[j]); /* of the inverse of lower */
    }
    for (int i = 0; i < HAND; i++) {
        modes[i][i] = 1.0;
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int k = 0; k <= j; k++)
                sum += columns[k][i] * law->stiffness[at + k] * columns[k][j];
            turned[i][j] = turned[j][i] = sum;
        }
    }
    diagonal(turned, modes);
    for (int i = 0; i < HAND; i++)
        for (int j = 0; j < HAND; j++) {
            q[i][j] = 0.0;
            for (int k = 0; k <= i; k++)
                q[i][j] += lower[i][k] * modes[k][j];
        }
    for (int i = 0; i < HAND; i++)
        for (int j = 0; j <= i; j++) {
            double sum = 0.0;
            for (int k = 0; k < HAND; k++)
                sum += q[i][k] * law->twice_ratio * sqrt(fmax(turned[k][k], 0.0)) * q[j][k];
            law->damping[at + i][at + j] = law->damping[at + j][at + i] = sum;
        }
    return 1;
}

/* Write D, block diagonal; 0 if a block of Lam is not positive definite. */
int law_damping(Law *law)
{
    memset(law->damping, 0, sizeof law->damping);
    return damp(law, 0) && damp(law, HAND);
}

/* Write tau = J' (K e - D J slip + h - Lam J M^-1 p) + p, with the posture's torque p = Kn stray - Dn slip. */
void law_torque(Law *law)
{
    double force[TASK], moved[TASK], posture[JOINTS], felt[TASK];
    for (int k = 0; k < JOINTS; k++)
        posture[k] = law->posture_stiffness[k] * law->stray[k] - law->posture_damping[k] * law->slip[k];
    for (int i = 0; i < TASK; i++) {
        moved[i] = felt[i] = 0.0;
        for (int k = 0; k < JOINTS; k++) {
            moved[i] += law->jacobian[i][k] * law->slip[k];
            felt[i] += law->through[i][k] * posture[k];
        }
    }
    for (int i = 0; i < TASK; i++) {
        force[i] = law->stiffness[i] * law->error[i] + law->wrench[i];
        for (int j = 0; j < TASK; j++)
            force[i] -= law->damping[i][j] * moved[j] + law->inertia[i][j] * felt[j];
    }
    for (int k = 0; k < JOINTS; k++) {
        law->torque[k] = posture[k];
        for (int i = 0; i < TASK; i++)
            law->torque[k] += law->jacobian[i][k] * force[i];
    }
}
