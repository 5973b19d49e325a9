/* The slope of a table at x, to the right of a point. */
static double table_slope(int n, const double *xs, const double *ys, double x)
{
    const int i = points_below(n, xs, x);
    return i > 0 && i < n ? (ys[i] - ys[i - 1]) / (xs[i] - xs[i - 1]) : 0.0;
}
