/* Cholesky's factor of a symmetric, positive definite matrix, and what it solves. Rows are next to each other. */

#include <math.h>

/* Write the lower factor over the lower part of a (n, n); 0 if a is not positive definite. */
static inline int factor(double *a, int n)
{
    for (int j = 0; j < n; j++) {
        for (int i = j; i < n; i++) {
            double sum = a[n * i + j];
            for (int k = 0; k < j; k++)
                sum -= a[n * i + k] * a[n * j + k];
            if (i > j)
                a[n * i + j] = sum / a[n * j + j];
            else if (sum > 0.0)
                a[n * j + j] = sqrt(sum);
            else
                return 0;
        }
    }
    return 1;
}

/* Solve L x = b (n,) in place. */
static inline void forward(const double *l, int n, double *b)
{
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++)
            b[i] -= l[n * i + k] * b[k];
        b[i] /= l[n * i + i];
    }
}

/* Solve L L' x = b (n,) in place. */
static inline void substitute(const double *l, int n, double *b)
{
    forward(l, n, b);
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++)
            b[i] -= l[n * k + i] * b[k];
        b[i] /= l[n * i + i];
    }
}
