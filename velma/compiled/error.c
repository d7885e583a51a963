/* The error of both hands in one call. The plain way, whose numbers these are, is velma.control.cartesian. */

#include <math.h>

typedef struct {
    double rotation[2][3][3], position[2][3], goal_rotation[2][3][3], goal_position[2][3]; /* read */
    double error[2][2][3];                                                                 /* written */
} Error;

/* Write log(r) (3,), for a rotation r (3, 3). */
static void rotation_vector(const double r[3][3], double *vector)
{
    double x = r[2][1] - r[1][2], y = r[0][2] - r[2][0], z = r[1][0] - r[0][1];
    double length = 0.5 * sqrt(x * x + y * y + z * z), cosine = 0.5 * (r[0][0] + r[1][1] + r[2][2] - 1.0);
    double angle = atan2(length, cosine);
    if (length > 1e-8 || cosine > 0.0) {
        double scale = length > 1e-8 ? 0.5 * angle / length : 0.5;
        vector[0] = scale * x, vector[1] = scale * y, vector[2] = scale * z;
        return;
    }
    /* Half a turn: r = 2 a a' - I, the axis a is the longest column of r + I. */
    int longest = 0;
    for (int k = 1; k < 3; k++)
        if (r[k][k] > r[longest][longest])
            longest = k;
    double axis[3], sum = 0.0;
    for (int k = 0; k < 3; k++) {
        axis[k] = r[k][longest] + (k == longest);
        sum += axis[k] * axis[k];
    }
    for (int k = 0; k < 3; k++)
        vector[k] = 3.14159265358979323846 * axis[k] / sqrt(sum);
}

void task_error(Error *e)
{
    for (int hand = 0; hand < 2; hand++) {
        double turn[3][3];
        for (int i = 0; i < 3; i++) {
            e->error[hand][0][i] = e->goal_position[hand][i] - e->position[hand][i];
            for (int j = 0; j < 3; j++) {
                turn[i][j] = 0.0;
                for (int k = 0; k < 3; k++)
                    turn[i][j] += e->goal_rotation[hand][i][k] * e->rotation[hand][j][k];
            }
        }
        rotation_vector(turn, e->error[hand][1]);
    }
}
