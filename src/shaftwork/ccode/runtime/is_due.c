/* Whether the time is a whole number of periods, as far as rounding tells. */
static int is_due(double t, double period)
{
    return fabs(t - period * round(t / period)) <= 2.0 * clearance(t);
}
