/* A table at x, constant beyond its ends. */
static double table(int n, const double *xs, const double *ys, double x)
{
    if (x <= xs[0]) return ys[0];
    if (x >= xs[n - 1]) return ys[n - 1];
    if (!(x == x)) return x;
    const int i = points_below(n, xs, x);
    return (ys[i] - ys[i - 1]) / (xs[i] - xs[i - 1]) * (x - xs[i - 1]) + ys[i - 1];
}
