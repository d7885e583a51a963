/* The error of both hands in one call. The plain way, whose numbers these are, is velma.control.cartesian. */

#include "rotation.h"

typedef struct {
    double rotation[2][9], position[2][3], goal_rotation[2][9], goal_position[2][3]; /* read */
    double error[2][6];                                                              /* written */
} Error;

/* Write the error of each hand [m, rad]. */
void task_error(Error *e)
{
    for (int hand = 0; hand < 2; hand++)
        difference(e->rotation[hand], e->position[hand], e->goal_rotation[hand], e->goal_position[hand], e->error[hand]);
}
