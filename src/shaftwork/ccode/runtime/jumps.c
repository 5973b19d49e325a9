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
