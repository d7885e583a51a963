/* The fastest motion along a path within limits of acceleration: the two passes of TOPP-RA (H. Pham, Q.-C. Pham, IEEE
   Transactions on Robotics 34(3), 2018), in the form of velma.kinematics.timing, which runs them in numpy without a library.

   At a grid point, x is the squared path speed and u the path acceleration up to the next point, where x becomes
   x + 2 d u. A joint limits both by a strip |a u + b x| <= h: once with its derivatives here, once with those of the
   next point. Zero lies in every strip, so a motion always exists. */

#include <math.h>
#include <stddef.h>

static const double STILL = 1e-9; /* rad per unit of path: joints slower than this limit no acceleration */

typedef struct {
    double a, b, h;
} Strip;

/* The strips of `joints` joints between a grid point and the next, `twice` = 2 d apart; a >= 0. */
static void strips(int joints, const double *first, const double *second, const double *limit, double twice, Strip *strip)
{
    for (int j = 0; j < joints; j++) {
        double b[2] = {second[j], second[joints + j]}, a[2] = {first[j], first[joints + j] + twice * b[1]};
        for (int k = 0; k < 2; k++)
            strip[k * joints + j] = (Strip){fabs(a[k]), a[k] < 0.0 ? -b[k] : b[k], limit[j]};
    }
}

/* The largest x from which the next point is reached with at most `next`, and which is at most `top`. */
static double largest(int count, const Strip *strip, double twice, double next, double top)
{
    for (int s = 0; s < count; s++) {
        Strip one = strip[s];
        double slope = one.a - twice * one.b, room = twice * one.h + (slope > 0.0 ? next * one.a : 0.0);
        top = fmin(top, room / fabs(slope));
        for (int t = 0; t < s; t++)
            top = fmin(top, (one.h * strip[t].a + strip[t].h * one.a) / fabs(one.b * strip[t].a - strip[t].b * one.a));
    }
    return top;
}

/* x (n,) holds the largest squared speeds at the grid, and afterwards those of the fastest motion, at rest at both ends.
   `first` and `second` (n, joints): derivatives of the path; `length` (n - 1,): from each grid point to the next. */
void path_speeds(int n, int joints, const double *first, const double *second, const double *limit, const double *length,
                 double *x)
{
    Strip strip[2 * joints];
    x[n - 1] = 0.0;
    for (int i = n - 2; i >= 0; i--) {
        size_t at = (size_t)i * joints;
        strips(joints, first + at, second + at, limit, 2.0 * length[i], strip);
        x[i] = largest(2 * joints, strip, 2.0 * length[i], x[i + 1], x[i]);
    }
    x[0] = 0.0;
    for (int i = 0; i < n - 1; i++) {
        size_t at = (size_t)i * joints;
        double twice = 2.0 * length[i];
        strips(joints, first + at, second + at, limit, twice, strip);
        for (int s = 0; s < 2 * joints; s++)
            if (strip[s].a > STILL)
                x[i + 1] = fmin(x[i + 1], x[i] + twice * ((strip[s].h - strip[s].b * x[i]) / strip[s].a));
        x[i + 1] = fmax(x[i + 1], 0.0);
    }
}
