#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "NAME.h"

/* The sizes of arrays; C knows no empty ones. */
enum {
    NX = NAME_STATES > 0 ? NAME_STATES : 1,
    NS = NAME_STORES > 0 ? NAME_STORES : 1,
    NM = NAME_MACHINES > 0 ? NAME_MACHINES : 1,
    NG = NAME_GUARDS > 0 ? NAME_GUARDS : 1,
    NGUARDS = NAME_GUARDS
};

/* How far beside an instant rounding may put it. */
static double clearance(double t)
{
    return 64.0 * DBL_EPSILON * fmax(fabs(t), 1e-6);
}
