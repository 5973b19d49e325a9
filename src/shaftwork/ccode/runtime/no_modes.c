static void guards(const NAME *m, double t, const double *x, double *g)
{
    (void)m;
    (void)t;
    (void)x;
    g[0] = -1.0;
}

const char *NAME_mode_name(int machine, int mode)
{
    (void)machine;
    (void)mode;
    return "";
}
