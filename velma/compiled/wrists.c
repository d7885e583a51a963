/* The filtered readings of both wrists in one call. The plain way, whose numbers these are, is velma.control.grip. */

#include <string.h>

enum { WINDOW = 25, FORCE = 0, ACCELERATION = 1 };

typedef double Felt[2][2][3]; /* force, acceleration of each hand */

typedef struct {
    /* read */
    double wrist[2][6], rotation[2][3][3], position[2][3], sign[2][3], up[3], rate, gain, point;
    /* kept from cycle to cycle, the number of which is counted from 0 */
    double cycle;
    Felt first, second, window[WINDOW];
    double points[2][2][3], before[2][3][3];
    /* written */
    Felt felt;
} Wrists;

/* x: what is measured now of one hand, in world axes. */
static void measure(Wrists *w, int hand, long long cycle, double x[2][3])
{
    double point[3];
    for (int i = 0; i < 3; i++) {
        point[i] = w->position[hand][i] + w->point * w->rotation[hand][i][2];
        if (cycle == 0) {
            w->points[0][hand][i] = w->points[1][hand][i] = point[i];
            memcpy(w->before[hand][i], w->rotation[hand][i], sizeof w->before[hand][i]);
        }
    }
    for (int i = 0; i < 3; i++) {
        double last = w->points[0][hand][i], before = w->points[1][hand][i];
        x[FORCE][i] = 0.0;
        for (int k = 0; k < 3; k++)
            x[FORCE][i] += w->wrist[hand][k] * w->sign[hand][k] * w->before[hand][i][k];
        x[ACCELERATION][i] = w->up[i];
        if (cycle >= 3)
            x[ACCELERATION][i] = (point[i] - 2.0 * last + before) * w->rate + w->up[i];
        w->points[1][hand][i] = last;
        w->points[0][hand][i] = point[i];
    }
    memcpy(w->before[hand], w->rotation[hand], sizeof w->before[hand]);
}

/* Take the readings of a cycle; write force and apparent gravity in the axes of the grips. */
void wrists_feel(Wrists *w)
{
    long long cycle = (long long)w->cycle; /* years of them */
    double(*now)[2][3] = w->window[cycle % WINDOW];
    for (int hand = 0; hand < 2; hand++) {
        double x[2][3];
        measure(w, hand, cycle, x);
        for (int kind = 0; kind < 2; kind++) {
            double *first = w->first[hand][kind], *second = w->second[hand][kind];
            if (cycle < 3) {
                memcpy(first, x[kind], sizeof x[kind]);
                memcpy(second, x[kind], sizeof x[kind]);
            }
            for (int i = 0; i < 3; i++) {
                first[i] += w->gain * (x[kind][i] - first[i]);
                second[i] += w->gain * (first[i] - second[i]);
            }
            for (int i = 0; i < 3; i++) {
                now[hand][kind][i] = 0.0;
                for (int k = 0; k < 3; k++)
                    now[hand][kind][i] += second[k] * w->rotation[hand][k][i];
            }
        }
    }
    for (long long later = cycle + 1; later < WINDOW; later++)
        memcpy(w->window[later], now, sizeof(Felt));
    const double *window = w->window[0][0][0];
    double *felt = w->felt[0][0];
    for (int i = 0; i < 12; i++) {
        felt[i] = 0.0;
        for (int k = 0; k < WINDOW; k++)
            felt[i] += window[12 * k + i];
        felt[i] /= WINDOW;
    }
    w->cycle += 1.0;
}
