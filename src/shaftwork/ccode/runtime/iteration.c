/* Past modes whose equations contradict others: into modes to which they lead, or something else gives way. */
static int instead(NAME *m, int machine, int to, int tried)
{
    const int now = m->mode[machine];
    for (int i = 0; i < N_LEAVES + 2 * NM; i++) {
        int mode[NM];
        memcpy(mode, m->mode, sizeof mode);
        if (i < N_LEAVES) {
            const Leave leave = LEAVES[i];
            if (leave.machine != machine || leave.from != to || leave.to < 0 || leave.to == now) continue;
            if (leave.how & (REBOUNDS | BY_TWIST)) continue;
            mode[machine] = leave.to;
        } else {
            const int k = (i - N_LEAVES) / 2, way = GIVES_WAY[2 * (k * MOST_MODES + m->mode[k]) + (i - N_LEAVES) % 2];
            if (k == machine || way < 0) continue;
            mode[machine] = to;
            mode[k] = way;
        }
        if (set_of(mode) < 0 || tried-- > 0) continue;
        NAME other = *m;
        double stored[NS], least = 1.0;
        stores(m, inside(m, m->t), m->x, stored);
        for (int k = 0; k < NAME_STORES; k++) least = fmax(least, fabs(stored[k]));
        (void)to_modes(&other, mode);
        if (differs(m, &other, NO_IMPACT * least) && !pulled(&other, NO_IMPACT * least, 0)) continue;
        *m = other;
        return 1;
    }
    return 0;
}

enum { NOTHING_CHANGES = 0, CHANGES = 1, STRIKES = 2, CONTRADICTS = 4 };

/* The mode of a machine changes, or what hits is thrown back. */
static int follow(NAME *m, int watch, int tried, const double *bands, double *late)
{
    const int leave = WATCHES[watch].leave, machine = LEAVES[leave].machine, now = m->mode[machine];
    int to = LEAVES[leave].to >= 0 ? LEAVES[leave].to : mode_anew(m, machine), slips;
    *late = 0.0;
    if (to < 0) return m->fault = NAME_NO_CONSISTENT_MODES;
    if (IS_SWITCH[machine] && switched(m, machine, to, bands)) return CHANGES;
    double speed = meets(m, machine, to);
    slips = speed != 0.0 ? way_of(machine, to, speed) : -1;
    if (slips == now) return NOTHING_CHANGES; /* it was met by rounding alone: it is moving away */
    if (slips >= 0 && !(LEAVES[leave].how & REBOUNDS)) {
        to = slips; /* its torque is limited, so it takes no speed away at once */
        speed = 0.0;
    }
    const NAME begun = *m;
    int mode[NM];
    memcpy(mode, m->mode, sizeof mode);
    mode[machine] = to;
    if (speed != 0.0 || ((LEAVES[leave].how & REBOUNDS) && slips < 0)) {
        if (strike(m, leave, late)) return STRIKES;
    } else if (commutated(m, mode)) return CHANGES;
    *m = begun;
    *late = 0.0;
    return instead(m, machine, to, tried) ? CHANGES | CONTRADICTS : (m->fault = NAME_NO_CONSISTENT_MODES);
}

static int in_seen(int seen[MOST_SEEN][NM], int count, const int *mode)
{
    for (int n = 0; n < count; n++)
        if (same_modes(seen[n], mode)) return 1;
    return 0;
}

static int worst_of(NAME *m, const NAME *before, const double *bands, const int *idle, int n_idle, int repeats)
{
    Excess found[2 * MOST_WATCHED] = {{0.0, 0}};
    const int in_order = repeats > 0, n = exceeded(m, before, bands, idle, n_idle, in_order, in_order, found);
    int first = 0;
    if (!n) return -1;
    for (int k = 1; k < n; k++)
        if (in_order ? LEAVES[WATCHES[found[k].watch].leave].machine < LEAVES[WATCHES[found[first].watch].leave].machine
                     : found[k].excess > found[first].excess)
            first = k;
    return found[first].watch;
}

/* Modes that are consistent with the motion that follows, one transition after another; how many, or a fault. */
static int consistent(NAME *m, int worst)
{
    const NAME before = *m;
    int seen[MOST_SEEN][NM], n_seen = 0, idle[MOST_WATCHED] = {0}, n_idle = 0, repeats = 0, transitions = 0, tried = 0;
    double bands[NG], late_by = 0.0;
    memcpy(bands, m->clear, sizeof bands);
    if (worst < 0) worst = worst_of(m, &before, bands, idle, 0, 0);
    while (worst >= 0) {
        double late;
        const int what = follow(m, worst, tried, bands, &late);
        if (what < 0) return what;
        late_by += late;
        if (what & CONTRADICTS) {
            if (++tried > 1) n_seen = 0;
        }
        const int changes = what != NOTHING_CHANGES, strikes = (what & STRIKES) != 0;
        transitions += changes;
        const int again = changes && !strikes && in_seen(seen, n_seen, m->mode);
        repeats += again;
        if (transitions > MOST_TRANSITIONS || repeats > 2) return m->fault = NAME_NO_CONSISTENT_MODES;
        if (again || strikes) n_seen = 0;
        if (strikes) tried = 0;
        if (changes) n_idle = 0;
        else if (n_idle < MOST_WATCHED) idle[n_idle++] = worst;
        if (n_seen < MOST_SEEN) memcpy(seen[n_seen++], m->mode, sizeof seen[0]);
        worst = worst_of(m, &before, bands, idle, n_idle, repeats);
        if (worst < 0 && late_by != 0.0) { /* in the modes that go on, how long ago it was hit */
            move(m, late_by);
            late_by = 0.0;
            worst = worst_of(m, &before, bands, idle, n_idle, repeats);
        }
    }
    return transitions;
}

/* Of several guards that are met at one instant each is followed first, and the fewest transitions are taken. */
static int iterate(NAME *m)
{
    double g[NG];
    int list[MOST_WATCHED] = {0}, first[MOST_WATCHED] = {0}, n_first = 0, named = -1, twists = 0, best = 0;
    const int count = watched(m, list), met = m->met;
    m->met = -1;
    for (int n = 0; n < count; n++)
        if (WATCHES[list[n]].guard == met) named = list[n];
    if (named < 0) return consistent(m, -1);
    NAME look = *m;
    Excess found[2 * MOST_WATCHED] = {{0.0, 0}};
    const int n_found = exceeded(&look, m, m->clear, list, 0, 1, 0, found);
    int all_by_torque = 1, has_named = 0;
    for (int k = 0; k < n_found; k++) {
        all_by_torque &= (LEAVES[WATCHES[found[k].watch].leave].how & BY_TORQUE) != 0;
        has_named |= found[k].watch == named;
    }
    guards(m, inside(m, m->t), m->x, g);
    for (int n = 0; n < count; n++) {
        int is_met = list[n] == named && (has_named || !(LEAVES[WATCHES[named].leave].how & BY_TORQUE) || all_by_torque);
        for (int k = 0; k < n_found; k++) is_met |= found[k].watch == list[n];
        if (!is_met) continue;
        first[n_first++] = list[n];
        twists += (LEAVES[WATCHES[list[n]].leave].how & BY_TWIST) != 0;
    }
    const int least = twists > 1 ? twists : 1;
    NAME outcome = *m;
    int fault = 0;
    for (int n = 0; n < n_first; n++) {
        NAME other = *m;
        const int transitions = consistent(&other, first[n]);
        if (transitions < 0) {
            fault = transitions;
            continue;
        }
        if (!best || transitions + 1 < best) {
            best = transitions + 1;
            outcome = other;
        }
        if (transitions <= 1 || transitions == least) break;
    }
    if (!best) return n_first ? (m->fault = fault) : consistent(m, -1);
    *m = outcome;
    return best - 1;
}

/* Machines that slip, with no speed across them as others hold their ends, pass to the modes in which they hold. */
static int hold_at_rest(NAME *m)
{
    int list[MOST_WATCHED] = {0}, slips[NM], mode[NM], any = 0;
    double dx[NX], x[NX], g[NG], near[NG];
    const int count = watched(m, list);
    for (int k = 0; k < NM; k++) slips[k] = -1;
    for (int n = 0; n < count; n++) {
        const Leave leave = LEAVES[WATCHES[list[n]].leave];
        for (int i = 0; i < N_LEAVES && leave.to >= 0; i++)
            if (LEAVES[i].machine == leave.machine && LEAVES[i].from == leave.to && LEAVES[i].to == leave.from &&
                (LEAVES[i].how & BY_TORQUE))
                slips[leave.machine] = list[n];
    }
    course(m, m->t, m->x, dx, g);
    beside(m, m->x, dx, 1.0, x);
    guards(m, inside(m, m->t + tick_of(m->t)), x, near);
    memcpy(mode, m->mode, sizeof mode);
    for (int k = 0; k < NM; k++) {
        if (slips[k] < 0) continue;
        const Watch w = WATCHES[slips[k]];
        const int still = AT_REST[m->set * NM + k] && (LEAVES[w.leave].how & BY_SPEED);
        if (!still && (g[w.guard] != 0.0 || near[w.guard] != 0.0)) continue;
        mode[k] = LEAVES[w.leave].to;
        if (set_of(mode) < 0) mode[k] = m->mode[k]; /* beside a prescribed speed not all of them can */
        else any = 1;
    }
    return any && to_modes(m, mode);
}

/* What `iterate` does, but where machines rest who carries is told anew: a law that falls at once would tell a way in
 * which nothing moves. */
static int iterate_at_rest(NAME *m)
{
    const NAME begun = *m;
    double g[NG];
    int list[MOST_WATCHED] = {0}, crossed = -1, ends = m->met >= 0;
    const int count = watched(m, list);
    guards(m, inside(m, m->t), m->x, g);
    for (int n = 0; n < count; n++) {
        const Watch w = WATCHES[list[n]];
        if (w.guard == m->met) crossed = w.leave;
        ends |= w.side * g[w.guard] > 0.0;
    }
    if (!ends || !hold_at_rest(m)) return iterate(m);
    for (int i = 0; i < NG; i++) m->clear[i] = 0.0;
    m->met = -1;
    NAME stuck = *m;
    const int transitions = consistent(m, -1);
    if (transitions < 0 || !same_modes(m->mode, begun.mode)) return transitions;
    const int held = watched(&stuck, list); /* rounding hides what was met */
    for (int n = 0; n < held; n++)
        if (WATCHES[list[n]].leave == crossed) stuck.met = WATCHES[list[n]].guard;
    *m = stuck;
    return iterate(m);
}

int NAME_event(NAME *m)
{
    int mode[NM], what = 0;
    double x[NX];
    memcpy(mode, m->mode, sizeof mode);
    memcpy(x, m->x, sizeof x);
    m->events++;
    if (m->t + clearance(m->t) >= m->next) {
        (void)sample(m);
        NAME jumps = *m;
        const int changed = jump(&jumps);
        int holds = 0;
        for (int k = 0; k < NM; k++) holds |= GIVES_WAY[2 * (k * MOST_MODES + m->mode[k])] >= 0;
        if (!(changed && holds && pulled(m, NO_IMPACT, 1))) *m = jumps;
        if (changed) m->met = -1;
    }
    const int transitions = iterate_at_rest(m);
    if (transitions < 0) return transitions;
    if (!same_modes(mode, m->mode)) what |= NAME_MODES_CHANGED;
    for (int i = 0; i < NX; i++)
        if (x[i] != m->x[i]) what |= NAME_STATES_CHANGED;
    return what;
}

int NAME_start(NAME *m, double t)
{
    int wanted[NM] = {0}, mode[NM] = {0};
    m->t = t;
    m->h = 0.0;
    m->fault = 0;
    m->met = -1;
    pass(m, t);
    put_modes(m, mode);
    for (int i = 0; i < NG; i++) m->clear[i] = 0.0;
    if (begin(m)) return m->fault;
    for (int i = 0; i < NAME_STATES; i++) {
        double stored[NS];
        stores(m, inside(m, t), m->x, stored);
        if (STORE_OF[i] >= 0) m->x[i] = stored[STORE_OF[i]];
    }
    for (int k = 0; k < NM; k++) {
        const int first = start_of(m, t, m->x, k, -1);
        wanted[k] = first >= 0 ? first : 0;
    }
    if (!to_modes(m, wanted)) {
        for (int round = 0; round < 2; round++) /* of switches the time tells, so that others give way */
            for (int k = 0; k < NM; k++) {
                int other[NM];
                if (IS_SWITCH[k] == round) continue;
                memcpy(other, mode, sizeof other);
                other[k] = wanted[k];
                for (int i = -1; i < N_LEAVES; i++) {
                    if (i >= 0) {
                        if (LEAVES[i].machine != k || LEAVES[i].from != wanted[k] || LEAVES[i].to < 0) continue;
                        if (LEAVES[i].how & BY_TIME) continue;
                        other[k] = LEAVES[i].to;
                    }
                    if (set_of(other) < 0) continue;
                    memcpy(mode, other, sizeof mode);
                    break;
                }
            }
        (void)to_modes(m, mode);
    }
    int transitions = consistent(m, -1);
    if (transitions >= 0 && sample(m)) transitions = consistent(m, -1);
    return transitions < 0 ? transitions : 0;
}

void NAME_guards(const NAME *m, double t, const double *x, double *g)
{
    double values[NG];
    guards(m, inside(m, t), x, values);
    for (int i = 0; i < NGUARDS; i++) g[i] = m->side[i] != 0 ? m->side[i] * values[i] - m->clear[i] : -1.0;
}
