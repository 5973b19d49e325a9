/* What is stored goes on beyond an instant at which sources jump. */
static int jump(NAME *m)
{
    double stored[NS], x[NX];
    int changed = 0;
    stores(m, inside(m, m->t), m->x, stored);
    pass(m, m->t);
    for (int i = 0; i < NX; i++) x[i] = m->x[i];
    take_up(m, inside(m, m->t), stored, x);
    for (int i = 0; i < NX; i++) {
        if (fabs(x[i] - m->x[i]) > 1e-12 * (NOMINAL[i] + fabs(x[i]))) changed = NAME_STATES_CHANGED;
        m->x[i] = x[i];
    }
    return changed;
}
