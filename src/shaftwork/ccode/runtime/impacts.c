/* Impacts as one problem: all contacts and freewheels that touch (Pfeiffer, Glocker 1996, chapter 8). */
static double opening(int machine, int mode)
{
    return OPENING[machine * MOST_MODES + mode];
}

static int way_of(int machine, int mode, double side)
{
    for (int n = 0; n < 2; n++)
        if (GIVES_WAY[2 * (machine * MOST_MODES + mode) + n] >= 0 && WAY_SIDE[2 * (machine * MOST_MODES + mode) + n] * side > 0.0)
            return GIVES_WAY[2 * (machine * MOST_MODES + mode) + n];
    return -1;
}

/* Whether a machine holds by a torque that is limited on both sides. */
static int rubs(int machine, int mode)
{
    return GIVES_WAY[2 * (machine * MOST_MODES + mode) + 1] >= 0;
}

static Contact closing(const NAME *m, int leave, double side, int apart)
{
    Contact c = {LEAVES[leave].machine, apart, LEAVES[leave].to, leave, side, 0.0, 0.0};
    double limit;
    leave_numbers(m, leave, &c.restitution, &c.rest, &limit);
    return c;
}

/* Contacts that are closed, and freewheels. */
static int lasting(const NAME *m, Contact *list)
{
    int n = 0;
    for (int k = 0; k < NM; k++) {
        const int mode = m->mode[k];
        if (opening(k, mode) != 0.0)
            list[n++] = (Contact){k, way_of(k, mode, opening(k, mode)), mode, -1, opening(k, mode), 0.0, 0.0};
    }
    for (int i = 0; i < N_LEAVES && n < MOST_CONTACTS; i++) {
        const Leave leave = LEAVES[i];
        if (m->mode[leave.machine] == leave.from && (leave.how & AS_IT_CLOSES) && leave.to >= 0)
            if (opening(leave.machine, leave.to) != 0.0)
                list[n++] = (Contact){leave.machine, leave.from, leave.to, i, opening(leave.machine, leave.to), 0.0, 0.0};
    }
    return n;
}

/* Contacts that are closed or touch, freewheels, and the machine that wants to close by a leave; that one last. */
static int touching(const NAME *m, int wanted, Contact *list)
{
    double bands[NG], g[NG];
    int guarded[MOST_WATCHED];
    int n = lasting(m, list);
    const int closed = n;
    bands_of(m, bands);
    guards(m, inside(m, m->t), m->x, g);
    for (int k = 0; k < closed; k++) { /* the other flank touches too where there is no gap between them */
        const Contact c = list[k];
        const int place = TWIST_PLACE[m->set * NM + c.machine];
        for (int i = 0; i < N_LEAVES && place >= 0; i++) {
            const Leave leave = LEAVES[i];
            double restitution, rest, limit;
            if (leave.machine != c.machine || leave.from != c.apart || !(leave.how & REBOUNDS) || leave.to == c.joined) continue;
            leave_numbers(m, i, &restitution, &rest, &limit);
            if (opening(c.machine, leave.to) != 0.0 && leave.twist_slope * (m->x[place] - limit) > -1e-200 && n < MOST_CONTACTS)
                list[n++] = closing(m, i, opening(c.machine, leave.to), c.apart);
        }
    }
    for (int k = 0, count = watched(m, guarded); k < count; k++) {
        const Watch w = WATCHES[guarded[k]];
        const Leave leave = LEAVES[w.leave];
        const int wants = leave.machine == LEAVES[wanted].machine && leave.to == LEAVES[wanted].to;
        const int touches = (leave.how & REBOUNDS) && w.side * g[w.guard] > -CLEAR * bands[w.guard];
        int is_closed = 0;
        if (!(wants || touches) || leave.to < 0 || opening(leave.machine, leave.to) == 0.0) continue;
        for (int i = 0; i < closed; i++) is_closed |= list[i].machine == leave.machine && list[i].joined == leave.to;
        if (!is_closed && n < MOST_CONTACTS)
            list[n++] = closing(m, wants ? wanted : w.leave, opening(leave.machine, leave.to), m->mode[leave.machine]);
    }
    for (int k = 0; k < n; k++)
        if (list[k].machine == LEAVES[wanted].machine && list[k].joined == LEAVES[wanted].to) {
            const Contact c = list[k];
            list[k] = list[n - 1];
            list[n - 1] = c;
            break;
        }
    return n;
}

static void opens_at(const NAME *m, const Contact *c, int n, double *opens)
{
    double speeds[NM];
    across(m, inside(m, m->t), m->x, speeds);
    for (int k = 0; k < n; k++) opens[k] = c[k].side * speeds[c[k].machine];
}

static double share_back(const Contact *c, double opens)
{
    return -opens * c->restitution > c->rest ? c->restitution : 0.0;
}

/* Of contacts that throw back only the fastest take part where impacts follow each other. */
static int in_turn(const NAME *m, Contact *c, int n)
{
    double opens[MOST_CONTACTS], fastest = 0.0;
    int left = 0, any = 0;
    opens_at(m, c, n, opens);
    for (int k = 0; k < n; k++)
        if (share_back(c + k, opens[k]) > 0.0) {
            fastest = any ? fmax(fastest, -opens[k]) : -opens[k];
            any = 1;
        }
    for (int k = 0; k < n; k++)
        if (!(any && c[k].restitution > 0.0) || -opens[k] >= (1.0 - NO_IMPACT) * fastest) c[left++] = c[k];
    return left;
}

/* The same, but zero where inertias and prescribed speeds do not tell the speed, as no impulse passes there. */
static void passing_at(const NAME *m, const Contact *c, int n, double *opens)
{
    opens_at(m, c, n, opens);
    for (int k = 0; k < n; k++)
        if (!HAS_INERTIA[m->set * NM + c[k].machine]) opens[k] = 0.0;
}

/* The changes of the speeds of inertias by unit impulses at contacts, and those of the speeds across contacts. */
static void mobility(const NAME *m, const Contact *c, int n, double *answers, double *W)
{
    double mass[NX * NX] = {0.0}, gains[NM * NX] = {0.0};
    const int speeds = SPEEDS[m->set];
    masses(m, inside(m, m->t), m->x, mass);
    shares(m, inside(m, m->t), m->x, gains);
    for (int k = 0; k < n; k++)
        for (int j = 0; j < speeds; j++) answers[k * speeds + j] = c[k].side * gains[c[k].machine * NX + j];
    solve(speeds, mass, n, answers);
    for (int i = 0; i < n; i++)
        for (int k = 0; k < n; k++) {
            W[i * n + k] = 0.0;
            for (int j = 0; j < speeds; j++) W[i * n + k] += c[i].side * gains[c[i].machine * NX + j] * answers[k * speeds + j];
        }
}

static void push(NAME *m, const double *answers, int n, const double *impulses)
{
    const int speeds = SPEEDS[m->set];
    for (int k = 0; k < n; k++)
        for (int j = 0; j < speeds; j++) m->x[SPEED_PLACE[m->set * NX + j]] += answers[k * speeds + j] * impulses[k];
}

/* lambda >= 0 with w = W lambda + q >= 0 and lambda w = 0 by an active set (Lawson, Hanson 1974); 0 where none is found.
 * A little more on the diagonal finds the least of many solutions; what that takes from it two further solutions give
 * back. */
static int complementary(const double *W, const double *q, int n, double *impulses)
{
    double scale[MOST_CONTACTS], V[MOST_CONTACTS * MOST_CONTACTS], b[MOST_CONTACTS], wanted[MOST_CONTACTS];
    double part[MOST_CONTACTS * MOST_CONTACTS];
    int active[MOST_CONTACTS] = {0}, place[MOST_CONTACTS];
    double most = 0.0;
    for (int i = 0; i < n; i++) {
        if (W[i * n + i] <= 0.0 && q[i] < 0.0) return 0;
        scale[i] = W[i * n + i] > 0.0 ? 1.0 / sqrt(W[i * n + i]) : 0.0;
        b[i] = q[i] * scale[i];
        most = fmax(most, fabs(b[i]));
        impulses[i] = 0.0;
    }
    for (int i = 0; i < n; i++)
        for (int k = 0; k < n; k++) V[i * n + k] = W[i * n + k] * scale[i] * scale[k];
    for (int round = 0, polished = 0; round <= 3 * n + 2; round++) {
        int worst = -1;
        double least = -1e-12 * most;
        for (int i = 0; i < n; i++) {
            double w = b[i];
            for (int k = 0; k < n; k++) w += V[i * n + k] * impulses[k];
            if (!active[i] && w < least) {
                least = w;
                worst = i;
            }
        }
        if (worst >= 0) active[worst] = 1;
        else if (polished++ == 2) {
            for (int i = 0; i < n; i++) impulses[i] *= scale[i];
            return 1;
        }
        for (int inner = 0; inner <= n; inner++) {
            int size = 0, pulls = 0;
            double share = 1.0;
            for (int i = 0; i < n; i++)
                if (active[i]) place[size++] = i;
            for (int i = 0; i < size; i++) {
                wanted[i] = -b[place[i]];
                for (int k = 0; k < size; k++) {
                    wanted[i] -= V[place[i] * n + place[k]] * impulses[place[k]];
                    part[i * size + k] = V[place[i] * n + place[k]] + (i == k ? 1e-10 : 0.0);
                }
            }
            solve(size, part, 1, wanted);
            for (int i = 0; i < size; i++) {
                wanted[i] += impulses[place[i]];
                if (wanted[i] > 0.0) continue;
                pulls = 1;
                share = fmin(share, impulses[place[i]] / fmax(impulses[place[i]] - wanted[i], 1e-300));
            }
            for (int i = 0; i < size; i++) {
                const int k = place[i];
                impulses[k] += pulls ? share * (wanted[i] - impulses[k]) : wanted[i] - impulses[k];
                if (pulls && wanted[i] <= 0.0 && impulses[k] <= 1e-12 * most) {
                    impulses[k] = 0.0;
                    active[k] = 0;
                }
            }
            if (!pulls) break;
        }
    }
    return 0;
}

/* Impulses in the ratio of shares by which contacts give back an energy. */
static void of_energy(double energy, const double *back, const double *opens, const double *W, int n, double *impulses)
{
    double linear = 0.0, square = 0.0, factor = 0.0;
    for (int i = 0; i < n; i++) {
        linear += back[i] * opens[i];
        for (int k = 0; k < n; k++) square += back[i] * W[i * n + k] * back[k];
    }
    if (energy > 0.0) {
        const double root = sqrt(linear * linear + 2.0 * fmax(square, 0.0) * energy);
        if (!(square > 0.0)) factor = 1.0;
        else factor = linear > 0.0 ? 2.0 * energy / (linear + root) : (root - linear) / square;
    }
    for (int i = 0; i < n; i++) impulses[i] = factor * back[i];
}

/* All contacts open, and what rubs slips. */
static int loosen(NAME *m, const Contact *c, int n)
{
    int mode[NM];
    for (int k = 0; k < NM; k++) {
        const int way = GIVES_WAY[2 * (k * MOST_MODES + m->mode[k])];
        mode[k] = rubs(k, m->mode[k]) ? way : m->mode[k];
    }
    for (int k = 0; k < n; k++) mode[c[k].machine] = c[k].apart;
    return to_modes(m, mode);
}

static int goes_on(const NAME *m, const Contact *c, int n)
{
    NAME other = *m;
    return loosen(&other, c, n) && keeps(m, &other, 1);
}

/* The contacts that an impact may open: not diodes and freewheels that alone let a current or torque go on. */
static int may_open(const NAME *m, Contact *c, int n)
{
    Contact opened[MOST_CONTACTS];
    int opens[MOST_CONTACTS], count = 0, left = 0;
    if (!HAS_TORQUES) return n;
    for (int k = 0; k < n; k++) {
        opens[k] = c[k].leave >= 0 || !ONE_WAY[c[k].machine];
        if (opens[k]) opened[count++] = c[k];
    }
    if (count == n || goes_on(m, c, n)) return n;
    for (int k = 0; k < n; k++) {
        if (opens[k]) continue;
        opened[count] = c[k];
        opens[k] = goes_on(m, opened, count + 1);
        count += opens[k];
    }
    for (int k = 0; k < n; k++)
        if (opens[k]) c[left++] = c[k];
    return left;
}

/* From modes in which all contacts are open, and what rubs slips: contacts stop what closes; shares of the impulses
 * come back. 0 where modes contradict each other. The impulses of both parts are added up, by contact. */
static int collided(NAME *m, const Contact *c, int n, const double *back, double *pressed)
{
    double answers[MOST_CONTACTS * NX], W[MOST_CONTACTS * MOST_CONTACTS], opens[MOST_CONTACTS] = {0.0};
    int mode[NM], any = 0;
    if (!loosen(m, c, n)) return 0;
    memcpy(mode, m->mode, sizeof mode);
    mobility(m, c, n, answers, W);
    passing_at(m, c, n, opens);
    for (int k = 0; k < n; k++) pressed[k] = 0.0;
    if (complementary(W, opens, n, pressed)) push(m, answers, n, pressed);
    else {
        for (int k = 0; k < n; k++)
            if (opens[k] < 0.0) mode[c[k].machine] = c[k].joined;
        if (!to_modes(m, mode)) return 0;
    }
    for (int k = 0; k < n; k++) any |= back[k] > 0.0;
    if (!any) return 1;
    double shares_back[MOST_CONTACTS], impulses[MOST_CONTACTS], rest[MOST_CONTACTS], energy = 0.0;
    mobility(m, c, n, answers, W);
    passing_at(m, c, n, opens);
    for (int k = 0; k < n; k++) shares_back[k] = back[k] * pressed[k];
    for (int i = 0; i < n; i++)
        for (int k = 0; k < n; k++) energy += 0.5 * shares_back[i] * W[i * n + k] * shares_back[k];
    of_energy(energy, shares_back, opens, W, n, impulses);
    for (int i = 0; i < n; i++) {
        rest[i] = fmax(opens[i], 0.0);
        for (int k = 0; k < n; k++) rest[i] += W[i * n + k] * impulses[k];
    }
    double beside_them[MOST_CONTACTS];
    if (complementary(W, rest, n, beside_them))
        for (int k = 0; k < n; k++) impulses[k] += beside_them[k];
    push(m, answers, n, impulses);
    return 1;
}

/* The modes after an impact: what is hit and does not open stays closed, and what rubs slips where it moves. No impulse
 * tells whether contacts beside massless nodes press: where they would take one, each is joined as its ends still come
 * together. */
static int closed_at_end(NAME *m, const int *before, const Contact *c, int n, double least, const int *hit, int *stays)
{
    double opens[MOST_CONTACTS], speeds[NM];
    int closed[NM], mode[NM], open_yet[MOST_CONTACTS], left = 0;
    passing_at(m, c, n, opens);
    across(m, inside(m, m->t), m->x, speeds);
    for (int k = 0; k < NM; k++) {
        closed[k] = m->mode[k];
        if (!rubs(k, before[k])) continue;
        const int way = fabs(speeds[k]) > least ? way_of(k, before[k], speeds[k]) : -1;
        closed[k] = way >= 0 ? way : before[k];
    }
    memcpy(mode, closed, sizeof mode);
    for (int k = 0; k < n; k++) {
        stays[k] = opens[k] <= least && (c[k].leave < 0 || hit[k]);
        open_yet[k] = stays[k] && c[k].leave < 0 && !HAS_INERTIA[m->set * NM + c[k].machine];
        left += open_yet[k];
        if (stays[k]) closed[c[k].machine] = c[k].joined;
        if (stays[k] && !open_yet[k]) mode[c[k].machine] = c[k].joined;
    }
    NAME apart = *m;
    if (!to_modes(m, closed)) return 0;
    if (!left) return 1;
    if (!to_modes(&apart, mode)) return 0;
    if (!differs(m, &apart, least)) return 1;
    while (left > 0) {
        int first = -1;
        opens_at(&apart, c, n, opens);
        for (int k = 0; k < n; k++)
            if (open_yet[k] && (first < 0 || opens[k] < opens[first])) first = k;
        if (opens[first] >= -least) break;
        if (!with_mode(&apart, c[first].machine, c[first].joined)) return 0;
        open_yet[first] = 0;
        left--;
    }
    for (int k = 0; k < n; k++) stays[k] = stays[k] && !open_yet[k];
    *m = apart;
    return 1;
}

/* What follows where sources jump or something jams: what is closed takes it up or opens. */
static int pulled(NAME *m, double least, int sources_jump)
{
    Contact c[MOST_CONTACTS] = {{0, 0, 0, 0, 0.0, 0.0, 0.0}};
    double back[MOST_CONTACTS] = {0.0}, pressed[MOST_CONTACTS];
    int hit[MOST_CONTACTS], stays[MOST_CONTACTS], before[NM];
    const int n = may_open(m, c, lasting(m, c));
    memcpy(before, m->mode, sizeof before);
    if (sources_jump) {
        if (!loosen(m, c, n)) return 0;
        (void)jump(m);
    }
    if (!collided(m, c, n, back, pressed)) return 0;
    for (int k = 0; k < n; k++) hit[k] = pressed[k] > 0.0;
    return closed_at_end(m, before, c, n, least, hit, stays);
}

/* The impact of a machine that closes by a leave. 0 where modes contradict; thrown says whether it comes back. */
static int impact(NAME *m, int leave, int may_rebound, int *thrown)
{
    Contact c[MOST_CONTACTS] = {{0, 0, 0, 0, 0.0, 0.0, 0.0}};
    double opens[MOST_CONTACTS], back[MOST_CONTACTS], pressed[MOST_CONTACTS], fastest = 0.0, largest = 0.0;
    int hit[MOST_CONTACTS], stays[MOST_CONTACTS], before[NM], wanted = -1;
    int n = may_open(m, c, touching(m, leave, c));
    memcpy(before, m->mode, sizeof before);
    opens_at(m, c, n, opens);
    for (int k = 0; k < n; k++) fastest = fmax(fastest, -opens[k]);
    const int comes = fastest > 64.0 * DBL_EPSILON * top_speed(m);
    if (comes && !TOGETHER) n = in_turn(m, c, n);
    opens_at(m, c, n, opens);
    for (int k = 0; k < n; k++) {
        const int is_wanted = c[k].machine == LEAVES[leave].machine && c[k].joined == LEAVES[leave].to;
        back[k] = comes && (may_rebound || !is_wanted) ? share_back(c + k, opens[k]) : 0.0;
        largest = fmax(largest, fabs(opens[k]));
        if (is_wanted) wanted = k;
    }
    if (wanted < 0 && !with_mode(m, LEAVES[leave].machine, LEAVES[leave].to)) return 0; /* as a switch that closes */
    if (!collided(m, c, n, back, pressed)) return 0;
    for (int k = 0; k < n; k++) hit[k] = c[k].leave >= 0 && ((comes && pressed[k] > 0.0) || k == wanted);
    if (!closed_at_end(m, before, c, n, NO_IMPACT * fmax(1.0, largest), hit, stays)) return 0;
    *thrown = wanted >= 0 && !stays[wanted];
    for (int k = 0; k < n; k++) {
        const int place = TWIST_PLACE[m->set * NM + c[k].machine];
        double restitution, rest, limit;
        if (!hit[k] || !stays[k] || place < 0 || LEAVES[c[k].leave].twist_slope == 0.0) continue;
        leave_numbers(m, c[k].leave, &restitution, &rest, &limit);
        m->x[place] = limit;
    }
    /* contacts that part, and are pushed back before they could be found again, stay closed */
    double bands[NG];
    int list[MOST_WATCHED], mode[NM], any = 0;
    bands_of(m, bands);
    memcpy(mode, m->mode, sizeof mode);
    for (int k = 0, count = watched(m, list); k < count; k++) {
        const Watch w = WATCHES[list[k]];
        const Leave back_to = LEAVES[w.leave];
        const int was = before[back_to.machine];
        if (was == m->mode[back_to.machine] || back_to.to != was || !(back_to.how & REBOUNDS)) continue;
        NAME later = *m;
        move(&later, 1.0);
        const double speed = back_to.twist_slope * across_one(m, back_to.machine);
        const double then = back_to.twist_slope * across_one(&later, back_to.machine);
        if (speed * speed < 4.0 * (then - speed) * CLEAR * bands[w.guard]) {
            mode[back_to.machine] = was;
            any = 1;
        }
    }
    return any ? to_modes(m, mode) : 1;
}

/* Of what is hit at an instant the leave of what closes fastest. */
static int fastest_leave(const NAME *m, int leave)
{
    Contact c[MOST_CONTACTS] = {{0, 0, 0, 0, 0.0, 0.0, 0.0}};
    double opens[MOST_CONTACTS];
    int first = -1, n = touching(m, leave, c);
    if (!TOGETHER) n = in_turn(m, c, n);
    opens_at(m, c, n, opens);
    for (int k = 0; k < n; k++) {
        if (!(share_back(c + k, opens[k]) > 0.0)) continue;
        if (c[k].machine == LEAVES[leave].machine) return leave;
        if (first < 0) first = c[k].leave;
    }
    return first >= 0 ? first : leave;
}

/* An impact; what hits is thrown back where it has passed its limit, and how long ago that was is told. */
static int strike(NAME *m, int leave, double *late)
{
    *late = 0.0;
    int thrown = 0;
    if (!(LEAVES[leave].how & REBOUNDS)) return impact(m, leave, 0, &thrown);
    int list[MOST_WATCHED], watch = -1;
    double dx[NX], x[NX], d[NX], g[2][NG];
    leave = fastest_leave(m, leave);
    for (int k = 0, count = watched(m, list); k < count; k++)
        if (WATCHES[list[k]].leave == leave) watch = list[k];
    if (watch < 0) return impact(m, leave, 1, &thrown);
    const Watch w = WATCHES[watch];
    course(m, m->t, m->x, dx, g[0]);
    const double step = ahead(m, dx), beyond = w.side * g[0][w.guard];
    further(m, m->t, step, m->x, dx, 0, x, d, g[1]);
    const double gain = w.side * g[1][w.guard] - beyond;
    if (beyond > 0.0 && beyond < gain) *late = beyond * step / gain;
    const NAME begun = *m;
    move(m, -*late);
    if (!impact(m, leave, 1, &thrown)) return 0;
    if (!thrown) return 1;
    /* it stays where a rebound would lose less than it gains, as it is found late by rounding */
    double restitution, rest, limit;
    const int k = LEAVES[leave].machine;
    leave_numbers(&begun, leave, &restitution, &rest, &limit);
    NAME later = *m;
    NAME_rhs(m, m->t, m->x, dx);
    const double look = ahead(m, dx), speed = across_one(&begun, k), away = across_one(m, k);
    move(&later, look);
    const double pushes = (speed < 0.0 ? -1.0 : 1.0) * (across_one(&later, k) - away) / look;
    const double loses = (1.0 - restitution * restitution) * speed * speed;
    if (!(loses > 0.0 && loses < 4.0 * beyond * pushes)) return 1;
    *m = begun;
    *late = 0.0;
    return impact(m, leave, 0, &thrown);
}
