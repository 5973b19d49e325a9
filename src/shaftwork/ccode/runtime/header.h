/* @TITLE@
 *
 * The motion of a network in C99, without dependencies and without allocation. An instance is one plain struct: memcpy
 * saves and restores it, and several of them live side by side. All quantities are in SI units.
 *
 *     NAME m;
 *     NAME_init(&m);                                  default parameters, everything at rest
 *     m.p[0] = 3.0;                                   a parameter, see NAME_parameter_names
 *     NAME_start(&m, 0.0);                            consistent states, and modes of the parts
 *     NAME_integrate(&m, 1.0, 1e-8);                  up to t = 1 s, with all events on the way
 *     NAME_outputs(&m, m.t, m.x, y);
 *
 * A solver of your own takes NAME_rhs, NAME_guards and NAME_next_time: it ends its steps where a guard rises above zero
 * and at the next instant of laws of time, puts time and states into m.t and m.x, and calls NAME_event.
 */
#ifndef NAME_H
#define NAME_H

#ifdef __cplusplus
extern "C" {
#endif

enum {
    NAME_STATES = @STATES@,
    NAME_STORES = @STORES@,         /* everything that is stored, be it a state or not */
    NAME_PARAMETERS = @PARAMETERS@,
    NAME_INPUTS = @INPUTS@,
    NAME_OUTPUTS = @OUTPUTS@,
    NAME_MACHINES = @MACHINES@,     /* parts that change their mode */
    NAME_GUARDS = @GUARDS@          /* what may end modes, at most */
};

/* What NAME_event returns: the sum of what has changed; or the negative code of a fault. */
enum { NAME_MODES_CHANGED = 1, NAME_STATES_CHANGED = 2 };

/* Faults; NAME_message has their texts. */
enum {
    NAME_STEP_TOO_SMALL = -1,
    NAME_TOO_MANY_EVENTS = -2,
    NAME_NO_CONSISTENT_MODES = -3,
    NAME_TOO_MANY_STEPS = -4,
    NAME_CONTRADICTORY_START = -5
};

typedef struct NAME {
    double t;                            /* time, s */
    double x[NAME_STATES + 1];           /* states */
    double p[NAME_PARAMETERS + 1];       /* parameters */
    double u[NAME_INPUTS + 1];           /* inputs */
    double start[NAME_STORES + 1];       /* start values of all that is stored; 0 of what follows from others */
    double number[NAME_MACHINES + 1];    /* of each mode in laws; follows from the modes */
    int mode[NAME_MACHINES + 1];         /* of each part, see NAME_mode_name */
    int set;                             /* of equations; follows from the modes */
    int side[NAME_GUARDS + 1];           /* 1 or -1 where a guard ends a mode as it rises or falls, else 0 */
    double clear[NAME_GUARDS + 1];       /* how far beyond zero a guard is met */
    int met;                             /* the guard that has ended the phase, or -1 */
    double next, since, until;           /* the next instant of laws of time; between which times they are read */
    double h;                            /* next step size, s; 0 where it has to be found */
    double look_ahead;                   /* how far at most an event looks ahead, s */
    long most_steps;                     /* of one call of NAME_integrate */
    int fault;                           /* 0, or the code of the last fault */
    long steps, rejected, events;        /* what NAME_integrate has done */
} NAME;

extern const char *const NAME_state_names[NAME_STATES + 1], *const NAME_state_units[NAME_STATES + 1];
extern const char *const NAME_store_names[NAME_STORES + 1];
extern const char *const NAME_parameter_names[NAME_PARAMETERS + 1], *const NAME_parameter_units[NAME_PARAMETERS + 1];
extern const char *const NAME_input_names[NAME_INPUTS + 1], *const NAME_input_units[NAME_INPUTS + 1];
extern const char *const NAME_output_names[NAME_OUTPUTS + 1], *const NAME_output_units[NAME_OUTPUTS + 1];
extern const char *const NAME_machine_names[NAME_MACHINES + 1];

/* The default parameters and inputs, and everything at rest. */
void NAME_init(NAME *m);

/* Consistent states from m->start, and the modes in which the motion begins; as NAME_event. */
int NAME_start(NAME *m, double t);

/* The rates of the states, dx[NAME_STATES]. */
void NAME_rhs(const NAME *m, double t, const double *x, double *dx);

/* Their slopes by the states, row by row: slopes[i * NAME_STATES + j] = d dx[i] / d x[j]. */
void NAME_jacobian(const NAME *m, double t, const double *x, double *slopes);

/* The outputs, y[NAME_OUTPUTS]. */
void NAME_outputs(const NAME *m, double t, const double *x, double *y);

/* How far each guard is beyond its limit, g[NAME_GUARDS]: negative while the modes go on. */
void NAME_guards(const NAME *m, double t, const double *x, double *g);

/* What happens at m->t with m->x: laws of time jump, and modes change until they agree with the motion that follows. */
int NAME_event(NAME *m);

/* The first instant after t at which a law of time jumps or bends; infinity where there is none. */
double NAME_next_time(const NAME *m, double t);

/* A step of h seconds by the same method as NAME_integrate, with events where they are. 0 or a fault. */
int NAME_step(NAME *m, double h);

/* On to t_end with all events, by Dormand and Prince's method of order 8 with step size control. 0 or a fault. */
int NAME_integrate(NAME *m, double t_end, double rtol);

/* The name of a mode of a part. */
const char *NAME_mode_name(int machine, int mode);

/* What a fault means. */
const char *NAME_message(int fault);

#ifdef __cplusplus
}
#endif
#endif
