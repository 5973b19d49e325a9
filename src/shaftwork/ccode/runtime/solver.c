/* The laws of time are read where nothing jumps: past the last instant of the past and before the next one. */
static double inside(const NAME *m, double t)
{
    return fmin(fmax(t, m->since), m->until);
}

void NAME_rhs(const NAME *m, double t, const double *x, double *dx)
{
    for (int i = 0; i < NX; i++) dx[i] = 0.0;
    rates(m, inside(m, t), x, dx);
}

void NAME_jacobian(const NAME *m, double t, const double *x, double *slopes)
{
    for (int i = 0; i < NX * NX; i++) slopes[i] = 0.0;
    jacobian(m, inside(m, t), x, slopes);
}

void NAME_outputs(const NAME *m, double t, const double *x, double *y)
{
    outputs(m, inside(m, t), x, y);
}

double NAME_next_time(const NAME *m, double t)
{
    return next_time(m, t + clearance(t));
}

/* The laws of time are read behind the instant t from here on. */
static void pass(NAME *m, double t)
{
    m->next = NAME_next_time(m, t);
    m->since = t + clearance(t);
    m->until = m->next - clearance(m->next);
}

static double error_norm(const double *v, const double *scale)
{
    double sum = 0.0;
    for (int i = 0; i < NX; i++) sum += (v[i] / scale[i]) * (v[i] / scale[i]);
    return sqrt(sum / NX);
}

/* The first step size: Hairer, Norsett, Wanner, section II.4. */
static double first_step(const NAME *m, const double *f, const double *scale, double span)
{
    double z[NX], g[NX];
    const double d0 = error_norm(m->x, scale), d1 = error_norm(f, scale);
    const double h = fmin(d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1, span);
    for (int i = 0; i < NX; i++) z[i] = m->x[i] + h * f[i];
    NAME_rhs(m, m->t + h, z, g);
    for (int i = 0; i < NX; i++) g[i] = (g[i] - f[i]) / h;
    const double largest = fmax(d1, error_norm(g, scale));
    const double next = largest <= 1e-15 ? fmax(1e-6, 1e-3 * h) : pow(0.01 / largest, 0.125);
    return fmin(fmin(100.0 * h, next), span);
}

#define STAGE(s)                                                          \
    for (int i = 0; i < NX; i++) z[i] = m->x[i] + h * (STAGE_##s(k, i)); \
    NAME_rhs(m, m->t + NODES[s] * h, z, k[s])

/* The eleven stages after k[0]; z is the end of the step, and the error over the scale is returned. */
static double try_step(const NAME *m, double h, double rtol, double k[16][NX], double *z)
{
    double e3 = 0.0, e5 = 0.0;
    STAGE(1); STAGE(2); STAGE(3); STAGE(4); STAGE(5); STAGE(6);
    STAGE(7); STAGE(8); STAGE(9); STAGE(10); STAGE(11);
    for (int i = 0; i < NX; i++) {
        z[i] = m->x[i] + h * (SOLUTION(k, i));
        const double scale = rtol * (NOMINAL[i] + fmax(fabs(m->x[i]), fabs(z[i])));
        const double third = (ERROR_3(k, i)) / scale, fifth = (ERROR_5(k, i)) / scale;
        e3 += third * third;
        e5 += fifth * fifth;
    }
    return e5 == 0.0 ? 0.0 : h * e5 / sqrt((e5 + 0.01 * e3) * NX);
}

/* The polynomial of order 7 between m->x and the end of the step: three more stages. */
static void interpolant(const NAME *m, double h, double k[16][NX], const double *end, double F[7][NX])
{
    double z[NX];
    STAGE(13); STAGE(14); STAGE(15);
    for (int i = 0; i < NX; i++) {
        const double change = end[i] - m->x[i];
        F[0][i] = change;
        F[1][i] = h * k[0][i] - change;
        F[2][i] = 2.0 * change - h * (k[12][i] + k[0][i]);
        F[3][i] = h * (DENSE_0(k, i));
        F[4][i] = h * (DENSE_1(k, i));
        F[5][i] = h * (DENSE_2(k, i));
        F[6][i] = h * (DENSE_3(k, i));
    }
}

static void between(const NAME *m, double F[7][NX], double part, double *x)
{
    const double rest = 1.0 - part;
    for (int i = 0; i < NX; i++) {
        const double high = F[3][i] + part * (F[4][i] + rest * (F[5][i] + part * F[6][i]));
        x[i] = m->x[i] + part * (F[0][i] + rest * (F[1][i] + part * (F[2][i] + rest * high)));
    }
}

/* How far the guard that is farthest beyond its limit is beyond it, and which one that is. */
static double farthest(const NAME *m, double t, const double *x, int *which)
{
    double g[NG], most = -1.0;
    *which = -1;
    if (NGUARDS == 0) return most;
    guards(m, inside(m, t), x, g);
    for (int i = 0; i < NG; i++) {
        if (m->side[i] == 0) continue;
        const double excess = m->side[i] * g[i] - m->clear[i];
        if (*which < 0 || excess > most) {
            most = excess;
            *which = i;
        }
    }
    return *which < 0 ? -1.0 : most;
}

/* Whether some guard may rise and fall again within a step, by the cubic through its ends and slopes there. */
static int may_touch(const NAME *m, double h, double k[16][NX], const double *end)
{
    double g[4][NG], z[2][NX];
    const double little = 1e-3 * h;
    if (NGUARDS == 0) return 0;
    for (int i = 0; i < NX; i++) {
        z[0][i] = m->x[i] + little * k[0][i];
        z[1][i] = end[i] - little * k[12][i];
    }
    guards(m, inside(m, m->t), m->x, g[0]);
    guards(m, inside(m, m->t + little), z[0], g[1]);
    guards(m, inside(m, m->t + h - little), z[1], g[2]);
    guards(m, inside(m, m->t + h), end, g[3]);
    for (int i = 0; i < NG; i++) {
        if (m->side[i] == 0) continue;
        const double first = m->side[i] * g[0][i] - m->clear[i], last = m->side[i] * g[3][i] - m->clear[i];
        const double rise = 1e3 * m->side[i] * (g[1][i] - g[0][i]), fall = 1e3 * m->side[i] * (g[2][i] - g[3][i]);
        if (rise <= 0.0 || fall <= 0.0) continue;
        for (int n = 1; n < 8; n++) {
            const double s = n / 8.0, r = 1.0 - s;
            const double cubic = r * r * ((1.0 + 2.0 * s) * first + s * rise) + s * s * ((1.0 + 2.0 * r) * last + r * fall);
            if (cubic > -0.1 * (rise + fall)) return 1;
        }
    }
    return 0;
}

/* The part of a step after which a guard is met, or 2 where none is. */
static double first_met(const NAME *m, double h, double F[7][NX], const double *end, int *which)
{
    double low = 0.0, high = 2.0, x[NX];
    for (int n = 1; n <= 8 && high > 1.0; n++) {
        const double part = n / 8.0;
        if (n < 8) between(m, F, part, x);
        if (farthest(m, m->t + part * h, n < 8 ? x : end, which) > 0.0) high = part;
        else low = part;
    }
    if (high > 1.0) return high;
    for (int n = 0; n < 60; n++) {
        const double part = 0.5 * (low + high);
        between(m, F, part, x);
        if (farthest(m, m->t + part * h, x, which) > 0.0) high = part;
        else low = part;
    }
    between(m, F, high, x);
    (void)farthest(m, m->t + high * h, x, which);
    return high;
}

/* Takes an accepted step up to its end, or to the guard that is met in it, and the event there. */
static int advance(NAME *m, double h, double stop, double k[16][NX], const double *end)
{
    double F[7][NX], part = 2.0;
    int which = -1;
    if (farthest(m, stop, end, &which) > 0.0 || may_touch(m, h, k, end)) {
        interpolant(m, h, k, end, F);
        part = first_met(m, h, F, end, &which);
    }
    if (part < 1.0) {
        double x[NX];
        between(m, F, part, x);
        for (int i = 0; i < NX; i++) m->x[i] = x[i];
        m->t += part * h;
    } else {
        for (int i = 0; i < NX; i++) m->x[i] = end[i];
        m->t = stop;
    }
    if (part > 1.0 && m->t < m->next) return 0;
    m->met = part > 1.0 ? -1 : which;
    const int what = NAME_event(m);
    return what < 0 ? what : 1;
}

int NAME_integrate(NAME *m, double t_end, double rtol)
{
    double k[16][NX], z[NX];
    int fresh = 1, rejected = 0;
    for (long step = 0; m->t < t_end; step++) {
        if (step > m->most_steps) return m->fault = NAME_TOO_MANY_STEPS;
        const double stop = fmin(t_end, m->next), left = stop - m->t;
        if (fresh) NAME_rhs(m, m->t, m->x, k[0]);
        fresh = 0;
        if (!(m->h > 0.0)) {
            double scale[NX];
            for (int i = 0; i < NX; i++) scale[i] = rtol * (NOMINAL[i] + fabs(m->x[i]));
            m->h = first_step(m, k[0], scale, left);
        }
        const int last = 1.01 * m->h >= left;
        const double h = last ? left : m->h;
        if (m->t + h == m->t && !last) return m->fault = NAME_STEP_TOO_SMALL;
        const double error = try_step(m, h, rtol, k, z);
        double factor = error == 0.0 ? 6.0 : fmin(6.0, fmax(1.0 / 3.0, 0.9 * pow(error, -0.125)));
        if (!(error < 1.0)) {
            m->h = h * (isfinite(error) ? fmin(factor, 1.0) : 0.1);
            m->rejected++;
            rejected = 1;
            continue;
        }
        const double end = last ? stop : m->t + h;
        NAME_rhs(m, end, z, k[12]);
        m->steps++;
        const int what = advance(m, h, end, k, z);
        if (what < 0) return what;
        if (what) fresh = 1;
        else
            for (int i = 0; i < NX; i++) k[0][i] = k[12][i];
        if (rejected) factor = fmin(factor, 1.0);
        rejected = 0;
        if (!last || h * factor > m->h) m->h = h * factor;
    }
    return 0;
}

int NAME_step(NAME *m, double h)
{
    const double end = m->t + h;
    double k[16][NX], z[NX];
    for (int n = 0; n < 100 && m->t < end; n++) {
        const double stop = fmin(end, m->next), left = stop - m->t;
        NAME_rhs(m, m->t, m->x, k[0]);
        (void)try_step(m, left, 1.0, k, z);
        NAME_rhs(m, stop, z, k[12]);
        m->steps++;
        const int what = advance(m, left, stop, k, z);
        if (what < 0) return what;
    }
    return m->t < end ? (m->fault = NAME_TOO_MANY_EVENTS) : 0;
}
