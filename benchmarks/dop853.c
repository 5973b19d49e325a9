/* The start of the crane by DOP853, as one would write it by hand in C for this one system.
 *
 * Method, error estimate, step control and dense output of order 7: Hairer, Norsett, Wanner, Solving Ordinary
 * Differential Equations I, sections II.4 to II.6. The coefficients come from dop853_tableau.h, which holds for each
 * stage s the sum STAGE_s(k, i) over its non-zero coefficients (likewise SOLUTION, ERROR_3, ERROR_5, DENSE_0..3).
 *
 * System (J1, J2 inertias, c and d of the shaft):
 *   J1 w1' = motor(w1) - M,   tau' = c (w1 - w2),   J2 w2' = M - tau_w tanh(w2/omega_s),   M = tau + d (w1 - w2)
 */
#include <math.h>
#include <string.h>

#include "dop853_tableau.h"

enum { N = 3, STAGES = 16 };

typedef struct {
    double J1, J2, c, d;
    double pull_out, slip_k, omega_sync; /* motor, referred to the shaft: N m, 1, rad/s */
    double tau_w, omega_s;
} Crane;

typedef struct {
    long steps, rejected, rhs;
} Counts;

static inline void rhs(const Crane *p, const double y[N], double dy[N])
{
    const double slip = 1.0 - y[0] / p->omega_sync;
    const double motor = 2.0 * p->pull_out * slip * p->slip_k / (slip * slip + p->slip_k * p->slip_k);
    const double twist_rate = y[0] - y[2];
    const double shaft = y[1] + p->d * twist_rate;
    dy[0] = (motor - shaft) / p->J1;
    dy[1] = p->c * twist_rate;
    dy[2] = (shaft - p->tau_w * tanh(y[2] / p->omega_s)) / p->J2;
}

static double rms(const double v[N], const double scale[N])
{
    double sum = 0.0;
    for (int i = 0; i < N; i++) sum += (v[i] / scale[i]) * (v[i] / scale[i]);
    return sqrt(sum / N);
}

/* First step size: II.4, "starting step size". */
static double first_step(const Crane *p, const double y[N], const double f[N], const double scale[N], double span)
{
    const double d0 = rms(y, scale), d1 = rms(f, scale);
    double h = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1, z[N], g[N];
    for (int i = 0; i < N; i++) z[i] = y[i] + h * f[i];
    rhs(p, z, g);
    for (int i = 0; i < N; i++) g[i] = (g[i] - f[i]) / h;
    const double largest = fmax(d1, rms(g, scale));
    const double h1 = largest <= 1e-15 ? fmax(1e-6, 1e-3 * h) : pow(0.01 / largest, 1.0 / 8.0);
    return fmin(fmin(100.0 * h, h1), span);
}

#define STAGE(s)                                                                \
    for (int i = 0; i < N; i++) z[i] = y[i] + h * STAGE_##s(k, i);              \
    rhs(p, z, k[s])

/* The eleven stages after k[0]; the solution z at the end of the step and its slope k[12]; the error over the scale. */
static double try_step(const Crane *p, const double y[N], double h, double atol[N], double rtol, double k[STAGES][N],
                       double z[N])
{
    STAGE(1); STAGE(2); STAGE(3); STAGE(4); STAGE(5); STAGE(6);
    STAGE(7); STAGE(8); STAGE(9); STAGE(10); STAGE(11);
    double e3 = 0.0, e5 = 0.0;
    for (int i = 0; i < N; i++) {
        z[i] = y[i] + h * SOLUTION(k, i);
        const double scale = atol[i] + rtol * fmax(fabs(y[i]), fabs(z[i]));
        e3 += pow(ERROR_3(k, i) / scale, 2);
        e5 += pow(ERROR_5(k, i) / scale, 2);
    }
    return e5 == 0.0 ? 0.0 : h * e5 / sqrt((e5 + 0.01 * e3) * N);
}

/* Coefficients of the dense output between y and z; costs three more stages. */
static void interpolant(const Crane *p, const double y[N], const double end[N], double h, double k[STAGES][N],
                        double F[7][N])
{
    double z[N];
    STAGE(13); STAGE(14); STAGE(15);
    for (int i = 0; i < N; i++) {
        const double dy = end[i] - y[i];
        F[0][i] = dy;
        F[1][i] = h * k[0][i] - dy;
        F[2][i] = 2.0 * dy - h * (k[12][i] + k[0][i]);
        F[3][i] = h * DENSE_0(k, i);
        F[4][i] = h * DENSE_1(k, i);
        F[5][i] = h * DENSE_2(k, i);
        F[6][i] = h * DENSE_3(k, i);
    }
}

static inline double between(const double y[N], double F[7][N], int i, double x)
{
    const double r = 1.0 - x;
    const double high = F[3][i] + x * (F[4][i] + r * (F[5][i] + x * F[6][i]));
    return y[i] + x * (F[0][i] + r * (F[1][i] + x * (F[2][i] + r * high)));
}

/* States at the increasing times t_out[0..n_out), row by row into y_out; 0, or -1 when the step size underflows. */
int crane_start(const Crane *p, const double y0[N], double t0, double t_end, double rtol, double atol[N],
                const double *t_out, int n_out, double *y_out, Counts *counts)
{
    double y[N], z[N], scale[N], k[STAGES][N], F[7][N], t = t0;
    int out = 0, rejected = 0;
    *counts = (Counts){0, 0, 2};
    memcpy(y, y0, sizeof y);
    rhs(p, y, k[0]);
    for (int i = 0; i < N; i++) scale[i] = atol[i] + rtol * fabs(y[i]);
    double h = first_step(p, y, k[0], scale, t_end - t0);
    for (; out < n_out && t_out[out] <= t0; out++) memcpy(y_out + N * out, y, sizeof y);
    while (t < t_end) {
        if (t + h == t) return -1;
        const int last = t + 1.01 * h >= t_end;
        if (last) h = t_end - t;
        const double error = try_step(p, y, h, atol, rtol, k, z);
        counts->rhs += 11;
        double factor = error == 0.0 ? 6.0 : fmin(6.0, fmax(1.0 / 3.0, 0.9 * pow(error, -1.0 / 8.0)));
        if (!(error < 1.0)) {
            h *= isfinite(error) ? fmin(factor, 1.0) : 0.1;
            counts->rejected++;
            rejected = 1;
            continue;
        }
        rhs(p, z, k[12]);
        counts->rhs++;
        counts->steps++;
        const double end = last ? t_end : t + h;
        if (out < n_out && t_out[out] <= end) {
            interpolant(p, y, z, h, k, F);
            counts->rhs += 3;
            for (; out < n_out && t_out[out] <= end; out++)
                for (int i = 0; i < N; i++) y_out[N * out + i] = between(y, F, i, (t_out[out] - t) / h);
        }
        t = end;
        memcpy(y, z, sizeof y);
        memcpy(k[0], k[12], sizeof k[0]);
        if (rejected) factor = fmin(factor, 1.0);
        rejected = 0;
        h *= factor;
    }
    return 0;
}
