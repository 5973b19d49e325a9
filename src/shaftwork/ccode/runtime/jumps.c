/* What sampled controllers hold from an instant on; whether that changes a state. */
static int sample(NAME *m)
{
    double x[NX];
    int changed = 0;
    for (int i = 0; i < NX; i++) x[i] = m->x[i];
    samples(m, inside(m, m->t), m->x, x);
    for (int i = 0; i < NX; i++) {
        if (x[i] != m->x[i]) changed = NAME_STATES_CHANGED;
        m->x[i] = x[i];
    }
    return changed;
}

/* The states at the start; what gears and the like tie to them follows, and may be given as it follows alone. */
static int begin(NAME *m)
{
    double stored[NS];
    const double t = inside(m, m->t);
    for (int i = 0; i < NX; i++) m->x[i] = 0.0;
    for (int i = 0; i < NAME_STATES; i++)
        if (START_OF[i] >= 0) m->x[i] = m->start[START_OF[i]];
    stores(m, t, m->x, stored);
    for (int k = 0; k < NAME_STORES; k++) {
        const double given = m->start[k], size = fmax(fabs(given), fabs(stored[k]));
        if (given < 0.0 || given > 0.0)
            if (!(fabs(given - stored[k]) <= 1e-9 * size)) return m->fault = NAME_CONTRADICTORY_START;
    }
    return 0;
}

/* What is stored goes on beyond an instant at which sources jump. */
static int jump(NAME *m)
{
    double stored[NS], after[NS], x[NX];
    int changed = 0;
    stores(m, inside(m, m->t), m->x, stored);
    pass(m, m->t);
    for (int i = 0; i < NX; i++) x[i] = m->x[i];
    take_up(m, inside(m, m->t), stored, x);
    for (int i = 0; i < NX; i++) {
        if (fabs(x[i] - m->x[i]) > 1e-12 * (NOMINAL[i] + fabs(x[i]))) changed = NAME_STATES_CHANGED;
        m->x[i] = x[i];
    }
    stores(m, inside(m, m->t), m->x, after); /* a speed that is prescribed is no state */
    for (int i = 0; i < NAME_STORES; i++)
        if (fabs(after[i] - stored[i]) > 1e-8 * fmax(fabs(after[i]), 1.0)) changed = NAME_STATES_CHANGED;
    return changed;
}
