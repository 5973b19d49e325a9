/* The first time after t at which a smooth function changes its sign, or one before which it does not. */
static double next_zero(const NAME *m, double (*function)(const NAME *, double), double width, double t)
{
    const int above = function(m, t) > 0.0;
    double low = t;
    for (int n = 1; n <= 32; n++) {
        double high = t + n * width / 16.0;
        if ((function(m, high) > 0.0) != above) {
            double middle = low + (high - low) / 2.0;
            for (int k = 0; k < 64 && low < middle && middle < high; k++) {
                if ((function(m, middle) > 0.0) != above) high = middle;
                else low = middle;
                middle = low + (high - low) / 2.0;
            }
            return high;
        }
        low = high;
    }
    return low > t ? low : INFINITY;
}
