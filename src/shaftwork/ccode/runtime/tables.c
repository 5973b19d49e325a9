/* The number of points of a table that are not above x. */
static int points_below(int n, const double *xs, double x)
{
    int low = 0, high = n;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (xs[middle] <= x) low = middle + 1;
        else high = middle;
    }
    return low;
}

/* A table at x, constant beyond its ends. */
static double table(int n, const double *xs, const double *ys, double x)
{
    if (x <= xs[0]) return ys[0];
    if (x >= xs[n - 1]) return ys[n - 1];
    if (!(x == x)) return x;
    const int i = points_below(n, xs, x);
    return (ys[i] - ys[i - 1]) / (xs[i] - xs[i - 1]) * (x - xs[i - 1]) + ys[i - 1];
}

/* Its slope at x, to the right of a point. */
static double table_slope(int n, const double *xs, const double *ys, double x)
{
    const int i = points_below(n, xs, x);
    return i > 0 && i < n ? (ys[i] - ys[i - 1]) / (xs[i] - xs[i - 1]) : 0.0;
}
