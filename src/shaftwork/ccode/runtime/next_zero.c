/* The first time after t at which a function of time that is smooth up to `end` changes its sign, or `end`. */
static double next_zero(const NAME *m, double (*value)(const NAME *, double), double t, double end)
{
    const int above = value(m, t) > 0.0;
    double low = t, high = end;
    if (!isfinite(end)) return end;
    for (int n = 1; n <= 16 && high == end; n++) {
        const double time = n < 16 ? t + (end - t) * n / 16.0 : end;
        if ((value(m, time) > 0.0) == above) low = time;
        else high = time;
    }
    if (low == end) return end;
    for (int n = 0; n < 60; n++) {
        const double time = 0.5 * (low + high);
        if ((value(m, time) > 0.0) == above) low = time;
        else high = time;
    }
    return high;
}
