/* What ends a mode: the mode that follows, what of the machine the guard reads, and how it does. */
typedef struct {
    int machine, from, to; /* to is -1 where the mode is that in which a motion would start */
    unsigned how;
    double twist_slope; /* of the guard by the twist */
} Leave;

/* A guard that may end a mode in a set of equations. */
typedef struct {
    int guard, side, leave;
} Watch;

enum { BY_TORQUE = 1, BY_TIME = 2, BY_TWIST = 4, REBOUNDS = 8, BY_SPEED = 16, AS_IT_CLOSES = 32, AS_IT_PULLS = 64 };
