/* The torque law of both hands in one call. The plain way, whose numbers these are, is velma.control.cartesian. */

#include <string.h>

#include "cholesky.h"

enum { JOINTS = 15, TASK = 12 };

typedef struct {
    /* read */
    double mass[JOINTS][JOINTS], jacobian[TASK][JOINTS];
    double error[TASK], slip[JOINTS], stray[JOINTS], wrench[TASK];
    double stiffness[TASK], damping[TASK][TASK];
    double posture_stiffness[JOINTS], posture_damping[JOINTS];
    double regularisation;
    /* written */
    double inertia[TASK][TASK], through[TASK][JOINTS], torque[JOINTS];
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
