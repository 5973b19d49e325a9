/* No part changes its mode: an event is a jump of a source. */
int NAME_event(NAME *m)
{
    m->met = -1;
    if (m->t + clearance(m->t) < m->next) return 0;
    m->events++;
    const int sampled = sample(m);
    return sampled | jump(m);
}

int NAME_start(NAME *m, double t)
{
    m->t = t;
    m->h = 0.0;
    m->fault = 0;
    m->met = -1;
    pass(m, t);
    if (begin(m)) return m->fault;
    (void)sample(m);
    return 0;
}

void NAME_guards(const NAME *m, double t, const double *x, double *g)
{
    (void)m;
    (void)t;
    (void)x;
    (void)g;
}
