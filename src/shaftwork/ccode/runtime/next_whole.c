/* The first time after t at which a line passes a whole number. */
static double next_whole(double slope, double offset, double t)
{
    const double value = slope * t + offset;
    if (slope == 0.0) return INFINITY;
    for (int n = 0; n < 3; n++) {
        const double time = ((slope > 0.0 ? floor(value) + n : ceil(value) - n) - offset) / slope;
        if (time > t) return time;
    }
    return INFINITY;
}
