/* The rules are those of Python's `shaftwork.hybrid`: consistency, event iteration, commutation, impacts. */
#define NO_IMPACT 1e-8
#define CLEAR 8.0
#define MOST_WATCHED (NM * MOST_LEAVES)
#define MOST_CONTACTS (3 * NM)
#define MOST_SEEN 64
#define MOST_TRANSITIONS 500

typedef struct {
    double excess;
    int watch;
} Excess;

typedef struct {
    int machine, apart, joined, leave; /* leave is -1 of what is closed already */
    double side, restitution, rest;
} Contact;

static int set_of(const int *mode)
{
    int place = 0;
    for (int k = 0; k < NM; k++) place += FORM_STRIDE[k] * FORM_OF[k * MOST_MODES + mode[k]];
    return SET_OF[place];
}

static int same_modes(const int *one, const int *other)
{
    for (int k = 0; k < NM; k++)
        if (one[k] != other[k]) return 0;
    return 1;
}

/* The watched guards of the modes; how many there are. */
static int watched(const NAME *m, int *list)
{
    int n = 0;
    for (int k = 0; k < NM; k++) {
        const int slice = 2 * ((m->set * NM + k) * MOST_MODES + m->mode[k]);
        for (int w = WATCHED[slice]; w < WATCHED[slice + 1]; w++) list[n++] = w;
    }
    return n;
}

static void put_modes(NAME *m, const int *mode)
{
    int list[MOST_WATCHED];
    for (int k = 0; k < NM; k++) {
        m->mode[k] = mode[k];
        m->number[k] = NUMBER_OF[k * MOST_MODES + mode[k]];
    }
    m->set = set_of(mode);
    for (int i = 0; i < NG; i++) m->side[i] = 0;
    for (int n = 0, count = watched(m, list); n < count; n++) m->side[WATCHES[list[n]].guard] = WATCHES[list[n]].side;
}

/* The same instant in other modes: all that is stored goes over. 0 where their equations contradict each other. */
static int to_modes(NAME *m, const int *mode)
{
    const int set = set_of(mode);
    double stored[NS];
    if (set < 0) return 0;
    if (set == m->set) {
        put_modes(m, mode);
        return 1;
    }
    stores(m, inside(m, m->t), m->x, stored);
    put_modes(m, mode);
    for (int i = 0; i < NX; i++) m->x[i] = 0.0;
    take_up(m, inside(m, m->t), stored, m->x);
    stores(m, inside(m, m->t), m->x, stored); /* what follows from the states now is told by them */
    for (int i = 0; i < NAME_STATES; i++)
        if (STORE_OF[i] >= 0) m->x[i] = stored[STORE_OF[i]];
    return 1;
}

static int with_mode(NAME *m, int machine, int to)
{
    int mode[NM];
    for (int k = 0; k < NM; k++) mode[k] = m->mode[k];
    mode[machine] = to;
    return to_modes(m, mode);
}

static double tick_of(double t)
{
    return 64.0 * DBL_EPSILON * fmax(fabs(t), 1.0);
}

/* Rates and guards at a time. */
static void course(const NAME *m, double t, const double *x, double *dx, double *g)
{
    NAME_rhs(m, t, x, dx);
    guards(m, inside(m, t), x, g);
}

/* The states as far away as rounding may move them, to one side or to the other, -1. */
static void beside(const NAME *m, const double *x, const double *dx, double side, double *moved)
{
    for (int i = 0; i < NX; i++) {
        const double tick = MOVE_PART[i] < 0.0 ? -tick_of(m->t) : tick_of(m->t);
        moved[i] = x[i] + side * (MOVE_PART[i] * fabs(x[i]) + MOVE_LEAST[i] + tick * fabs(dx[i]));
    }
}

/* How far ahead the further course is looked at: no state moves there by more than a part of its size. */
static double ahead(const NAME *m, const double *dx)
{
    double step = m->look_ahead;
    for (int i = 0; i < NX; i++)
        if (MOVE_REACH[i] < step * fabs(dx[i])) step = MOVE_REACH[i] / fabs(dx[i]);
    return step;
}

static void further(const NAME *m, double t, double step, const double *x, const double *dx, int bends, double *later,
                    double *dlater, double *g)
{
    for (int i = 0; i < NX; i++) later[i] = x[i] + step * dx[i];
    course(m, t + step, later, dlater, g);
    if (!bends) return;
    for (int i = 0; i < NX; i++) later[i] = x[i] + 0.5 * step * (dx[i] + dlater[i]);
    course(m, t + step, later, dlater, g);
}

static void move(NAME *m, double step)
{
    double dx[NX];
    NAME_rhs(m, m->t, m->x, dx);
    for (int i = 0; i < NX; i++) m->x[i] += step * dx[i];
}

/* How far rounding moves each guard. */
static void bands_of(const NAME *m, double *bands)
{
    double dx[NX], g[NG], near[NG], x[NX];
    course(m, m->t, m->x, dx, g);
    for (int n = 0; n <= SWITCHES; n++) {
        beside(m, m->x, dx, n ? -1.0 : 1.0, x);
        guards(m, inside(m, m->t + (n ? -tick_of(m->t) : tick_of(m->t))), x, near);
        for (int i = 0; i < NG; i++) bands[i] = n ? fmin(bands[i], fabs(near[i] - g[i])) : fabs(near[i] - g[i]);
    }
}

/* Of guards on their limit those that are about to go beyond it. */
static int leaving(const NAME *m, const int *list, int count, int again, Excess *beyond)
{
    double x[4][NX], dx[4][NX], g[4][NG];
    int open[MOST_WATCHED] = {0}, n_open = count, found = 0;
    double t = m->t;
    for (int i = 0; i < NX; i++) x[0][i] = m->x[i];
    course(m, t, x[0], dx[0], g[0]);
    beside(m, x[0], dx[0], 1.0, x[1]);
    course(m, t + tick_of(t), x[1], dx[1], g[1]);
    const double step = ahead(m, dx[0]), tick = tick_of(t);
    for (int n = 0; n < count; n++) open[n] = list[n];
    double from[2][NX], rate[2][NX];
    memcpy(from, x, sizeof from);
    memcpy(rate, dx, sizeof rate);
    for (int round = 0; round < (again ? 1 : 2) && !found; round++) {
        int left = 0;
        for (int n = 0; n < 2; n++) {
            further(m, t + (n ? tick : 0.0), step, from[n], rate[n], BENDS && !again, x[2 + n], dx[2 + n], g[2 + n]);
            memcpy(from[n], x[2 + n], sizeof from[n]);
            memcpy(rate[n], dx[2 + n], sizeof rate[n]);
        }
        t += step;
        for (int n = 0; n < n_open; n++) {
            const Watch w = WATCHES[open[n]];
            const double gain = w.side * (g[2][w.guard] - g[0][w.guard]), other = w.side * (g[3][w.guard] - g[1][w.guard]);
            const double band = fabs(g[1][w.guard] - g[0][w.guard]);
            const int drifts = fabs(gain) > fabs(gain - other) && fabs(gain) > band / 16.0;
            if (!drifts) open[left++] = open[n];
            else if (gain > 0.0) beyond[found++] = (Excess){gain, open[n]};
        }
        n_open = left;
    }
    return found;
}

/* The guards beyond their limits, or on them and about to go beyond; m->clear says how far each one is met. */
static int exceeded(NAME *m, const NAME *before, const double *before_bands, const int *idle, int n_idle, int in_order,
                    int again, Excess *out)
{
    double bands[NG], g[NG];
    int list[MOST_WATCHED] = {0}, on_limit[MOST_WATCHED] = {0}, n_on = 0, n_beyond = 0, hits = 0;
    Excess beyond[2 * MOST_WATCHED] = {{0.0, 0}}, soon[MOST_WATCHED] = {{0.0, 0}};
    const int count = watched(m, list), same = before->set == m->set;
    bands_of(m, bands);
    guards(m, inside(m, m->t), m->x, g);
    for (int i = 0; i < NG; i++) m->clear[i] = 0.0;
    for (int n = 0; n < count; n++) {
        const Watch w = WATCHES[list[n]];
        const double excess = w.side * g[w.guard], band = bands[w.guard], wide = CLEAR * band;
        const double broad = same ? fmax(band, before_bands[w.guard]) : band;
        int is_idle = 0;
        m->clear[w.guard] = (2.0 * excess > -wide ? fmax(excess, 0.0) + wide : band / CLEAR) + 1e-200;
        for (int k = 0; k < n_idle; k++) is_idle |= idle[k] == list[n];
        if (excess < -broad || is_idle) continue;
        if (excess <= broad || (LEAVES[w.leave].how & REBOUNDS)) on_limit[n_on++] = list[n];
        else beyond[n_beyond++] = (Excess){excess, list[n]};
    }
    /* impacts come first: torques are those of the motion after them */
    for (int n = 0; n < n_beyond; n++)
        if (!(LEAVES[WATCHES[beyond[n].watch].leave].how & BY_TORQUE)) out[hits++] = beyond[n];
    if (hits) return hits;
    int timed[MOST_WATCHED] = {0}, n_timed = 0;
    for (int n = 0; n < n_on; n++)
        if (LEAVES[WATCHES[on_limit[n]].leave].how & BY_TIME) timed[n_timed++] = on_limit[n];
    if (n_timed && (hits = leaving(m, timed, n_timed, 0, out)) > 0) return hits;
    const int n_soon = n_on ? leaving(m, on_limit, n_on, again, soon) : 0;
    for (int n = 0; n < n_soon; n++)
        if (LEAVES[WATCHES[soon[n].watch].leave].how & REBOUNDS) out[hits++] = soon[n];
    if (hits) return hits;
    if (in_order || !n_beyond)
        for (int n = 0; n < n_soon; n++) beyond[n_beyond++] = soon[n];
    for (int n = 0; n < n_beyond; n++) out[n] = beyond[n];
    return n_beyond;
}

/* The mode of a machine in which a motion would start, besides one; -1 where it would start in none. */
static int start_of(const NAME *m, double t, const double *x, int machine, int besides)
{
    double holds[NM * MOST_MODES];
    begins(m, inside(m, t), x, holds);
    for (int n = 0; n < MODES[machine]; n++)
        if (n != besides && holds[machine * MOST_MODES + n] != 0.0) return n;
    return -1;
}

static int mode_anew(const NAME *m, int machine)
{
    double dx[NX], x[NX];
    const int to = start_of(m, m->t, m->x, machine, m->mode[machine]);
    if (to >= 0) return to;
    NAME_rhs(m, m->t, m->x, dx);
    const double late = ahead(m, dx);
    for (int i = 0; i < NX; i++) x[i] = m->x[i] + late * dx[i];
    return start_of(m, m->t + late, x, machine, m->mode[machine]);
}

/* Whether torques, or speeds too, that are stored are the same in other modes. */
static int keeps(const NAME *m, const NAME *other, int torques_alone)
{
    double before[NS], after[NS];
    stores(m, inside(m, m->t), m->x, before);
    stores(other, inside(other, other->t), other->x, after);
    for (int torques = 0; torques < 2; torques++) {
        double change = 0.0, size = 0.0;
        if (!torques && torques_alone) continue;
        for (int i = 0; i < NAME_STORES; i++) {
            if (IS_TORQUE[i] != torques) continue;
            change += fabs(after[i] - before[i]);
            size += fabs(before[i]);
        }
        if (change > NO_IMPACT * size) return 0;
    }
    return 1;
}

static int differs(const NAME *m, const NAME *other, double least)
{
    double before[NS], after[NS];
    stores(m, inside(m, m->t), m->x, before);
    stores(other, inside(other, other->t), other->x, after);
    for (int i = 0; i < NAME_STORES; i++)
        if (fabs(after[i] - before[i]) > least) return 1;
    return 0;
}

/* Diodes and freewheels whose mode a speed that closes them ends, or a torque that pulls, with the modes that follow. */
static int led(const int *mode, unsigned how, int *leaves)
{
    int n = 0;
    for (int i = 0; i < N_LEAVES && n < NM; i++)
        if (mode[LEAVES[i].machine] == LEAVES[i].from && (LEAVES[i].how & how) && LEAVES[i].to >= 0 && ONE_WAY[LEAVES[i].machine])
            leaves[n++] = i;
    return n;
}

/* The first of sets of diodes with which what is stored goes on; 0 where there is none. */
static int keeping(NAME *m, const int *mode, const int *leaves, int n, int least, int torques_alone)
{
    int tried = 0;
    if (n > 16) n = 16;
    for (int size = least; size <= n; size++)
        for (unsigned mask = 0; mask < 1u << n && tried < 500; mask++) {
            int bits = 0, chosen[NM];
            Excess found[2 * MOST_WATCHED] = {{0.0, 0}};
            for (int k = 0; k < n; k++) bits += (int)(mask >> k & 1u);
            if (bits != size) continue;
            tried++;
            NAME other = *m;
            for (int k = 0; k < NM; k++) chosen[k] = mode[k];
            for (int k = 0; k < n; k++)
                if (mask >> k & 1u) chosen[LEAVES[leaves[k]].machine] = LEAVES[leaves[k]].to;
            if (!to_modes(&other, chosen) || !keeps(m, &other, torques_alone)) continue;
            int stays = 1;
            for (int k = 0, count = exceeded(&other, &other, other.clear, leaves, 0, 0, 0, found); k < count; k++)
                if (ONE_WAY[LEAVES[WATCHES[found[k].watch].leave].machine]) stays = 0;
            if (stays) {
                *m = other;
                return 1;
            }
        }
    return 0;
}

/* Machines pass to other modes, and diodes and freewheels to those in which they take over what is cut off. */
static int commutated(NAME *m, const int *mode)
{
    int leaves[NM] = {0};
    NAME plain = *m;
    if (!to_modes(&plain, mode)) return 0;
    if (plain.set != m->set && HAS_TORQUES && !keeps(m, &plain, 1))
        if (keeping(m, mode, leaves, led(mode, AS_IT_CLOSES, leaves), 1, 1)) return 1;
    *m = plain;
    return 1;
}

/* A switch changes, with all others whose time it is too, and diodes so that all that is stored goes on; else 0. */
static int switched(NAME *m, int machine, int to, const double *bands)
{
    int mode[NM], opens[NM], list[MOST_WATCHED], leaves[2 * NM] = {0}, changes = 1, n_opens = 0;
    double g[NG];
    guards(m, inside(m, m->t), m->x, g);
    for (int k = 0; k < NM; k++) mode[k] = m->mode[k];
    mode[machine] = to;
    for (int n = 0, count = watched(m, list); n < count; n++) {
        const Watch w = WATCHES[list[n]];
        const Leave leave = LEAVES[w.leave];
        if (leave.machine == machine || !(leave.how & BY_TIME) || !IS_SWITCH[leave.machine]) continue;
        if (w.side * g[w.guard] < -bands[w.guard] || mode[leave.machine] != m->mode[leave.machine]) continue;
        const int next = leave.to >= 0 ? leave.to : mode_anew(m, leave.machine);
        if (next < 0) continue;
        mode[leave.machine] = next;
        changes++;
    }
    int n = led(mode, AS_IT_CLOSES, leaves);
    n += led(mode, AS_IT_PULLS, leaves + n);
    if (keeping(m, mode, leaves, n, 0, 0)) return changes;
    for (int k = 0; k < NM; k++) {
        const int is_open = mode[k] != m->mode[k] && !RIGID[k * MOST_MODES + mode[k]];
        opens[k] = is_open ? mode[k] : m->mode[k];
        n_opens += is_open;
    }
    return n_opens > 0 && n_opens < changes && commutated(m, opens) ? n_opens : 0;
}

static double across_one(const NAME *m, int machine)
{
    double speeds[NM];
    across(m, inside(m, m->t), m->x, speeds);
    return speeds[machine];
}

static double top_speed(const NAME *m)
{
    double top = 0.0;
    for (int j = 0; j < SPEEDS[m->set]; j++) top = fmax(top, fabs(m->x[SPEED_PLACE[m->set * NX + j]]));
    return top;
}

/* The speed across a machine that is rigid from now on; zero where it is no more than an error of the run. */
static double meets(const NAME *m, int machine, int to)
{
    const int now = m->mode[machine];
    if (!RIGID[machine * MOST_MODES + to] || FORM_OF[machine * MOST_MODES + to] == FORM_OF[machine * MOST_MODES + now]) return 0.0;
    NAME other = *m;
    const double speed = across_one(m, machine), least = NO_IMPACT * fmax(1.0, top_speed(m));
    move(&other, -2.0 * CLEAR * tick_of(m->t));
    if (fabs(speed) <= least || fabs(speed) <= fabs(speed - across_one(&other, machine))) return 0.0;
    other = *m;
    if (!with_mode(&other, machine, to)) return speed;
    return differs(m, &other, least) ? speed : 0.0;
}
