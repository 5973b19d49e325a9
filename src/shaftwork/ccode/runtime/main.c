/* A run of @TITLE@: outputs at equal times as CSV.
 *
 *     cc -std=c99 -O2 -o run NAME.c main.c -lm && ./run > motion.csv        steps by a tolerance
 *     ./run 1e-3 > motion.csv                                              fixed steps of 1e-3 s
 */
#include <stdio.h>
#include <stdlib.h>

#include "NAME.h"

static void print_row(const NAME *m)
{
    double y[NAME_OUTPUTS + 1];
    NAME_outputs(m, m->t, m->x, y);
    printf("%.9g", m->t);
    for (int i = 0; i < NAME_OUTPUTS; i++) printf(",%.9g", y[i]);
    printf("\n");
}

int main(int count, char **arguments)
{
    const double t_end = @T_END@, step = count > 1 ? atof(arguments[1]) : 0.0;
    const int rows = 1000;
    NAME m;
    NAME_init(&m);
    int fault = NAME_start(&m, 0.0);
    printf("t");
    for (int i = 0; i < NAME_OUTPUTS; i++) printf(",%s", NAME_output_names[i]);
    printf("\n");
    for (int row = 0; row <= rows && fault >= 0; row++) {
        const double t = t_end * row / rows;
        while (step > 0.0 && m.t + 0.5 * step < t && fault >= 0) fault = NAME_step(&m, step);
        if (!(step > 0.0)) fault = NAME_integrate(&m, t, 1e-8);
        if (fault >= 0) print_row(&m);
    }
    if (fault < 0) fprintf(stderr, "t = %g s: %s\n", m.t, NAME_message(fault));
    return fault < 0;
}
