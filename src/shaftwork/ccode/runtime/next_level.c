/* The first time after t at which a line passes one of its levels, which increase. */
static double next_level(double slope, double offset, int n, const double *levels, double t)
{
    int low = 0, high = n;
    if (slope == 0.0) return INFINITY;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        const double time = (levels[middle] - offset) / slope;
        if (slope > 0.0 ? time <= t : time > t) low = middle + 1;
        else high = middle;
    }
    if (slope > 0.0) return low < n ? (levels[low] - offset) / slope : INFINITY;
    return low > 0 ? (levels[low - 1] - offset) / slope : INFINITY;
}
