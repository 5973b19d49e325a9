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
