#ifndef HOPOPT_TRACKER_H
#define HOPOPT_TRACKER_H

#include <string.h>
#include <tgmath.h>

#ifndef HOPOPT_REAL
#define HOPOPT_REAL float /* -DHOPOPT_REAL=double where the processor has doubles and memory for them */
#endif
typedef HOPOPT_REAL hopopt_real;
#define HOPOPT_R(number) ((hopopt_real)(number))

/* @TABLES@ */

#define HOPOPT_STATES (2 * HOPOPT_JOINTS)

/* A planned phase: at HOPOPT_TIMES places of every interval the time since the phase began [s], and the integrals of the
   joint torques since then [N m s]; at HOPOPT_PLACES places joint angles [rad] and speeds [rad/s]; the torques [N m] with
   which it begins and ends. At the knots, some of the control periods, the error's change by itself (A) and by torque (B), the feedback (K) and the filter (L), matrices row by row; in
   between they change linearly. */
typedef struct {
    int intervals, knots;
    const unsigned short *knot;
    const hopopt_real *t, *impulse, *q, *v, *begins, *ends, *A, *B, *K, *L;
} hopopt_phase;

static const hopopt_phase hopopt_stance = {
    HOPOPT_STANCE_INTERVALS, HOPOPT_STANCE_KNOTS, hopopt_stance_knot, hopopt_stance_t, hopopt_stance_impulse,
    hopopt_stance_q, hopopt_stance_v, hopopt_stance_begins, hopopt_stance_ends, hopopt_stance_A, hopopt_stance_B, hopopt_stance_K, hopopt_stance_L};
static const hopopt_phase hopopt_flight = {
    HOPOPT_FLIGHT_INTERVALS, HOPOPT_FLIGHT_KNOTS, hopopt_flight_knot, hopopt_flight_t, hopopt_flight_impulse,
    hopopt_flight_q, hopopt_flight_v, hopopt_flight_begins, hopopt_flight_ends, hopopt_flight_A, hopopt_flight_B, hopopt_flight_K, hopopt_flight_L};

/* What the tracker remembers between two calls; hopopt_reset makes it as it is before a hop. */
typedef struct {
    int known, contact, lost, early;
    hopopt_real t, began, error[HOPOPT_STATES], extra[HOPOPT_JOINTS], q[HOPOPT_JOINTS], v[HOPOPT_JOINTS], given[HOPOPT_JOINTS];
} hopopt_tracker;

static inline void hopopt_reset(hopopt_tracker *s) {
    memset(s, 0, sizeof *s);
    s->began = -INFINITY;
}

static inline hopopt_real hopopt_duration(const hopopt_phase *p) { return p->t[p->intervals * HOPOPT_TIMES - 1]; }

static inline hopopt_real hopopt_within(hopopt_real x, hopopt_real low, hopopt_real high) { return x < low ? low : x > high ? high : x; }

/* The last of `count` ascending times, `stride` apart, that is not above x; the first if all are. */
static inline int hopopt_find(const hopopt_real *t, int count, int stride, hopopt_real x) {
    int low = 0, high = count;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (t[middle * stride] <= x) low = middle; else high = middle;
    }
    return low;
}

/* q, v of a phase at t [s] since it began, clipped to it: the polynomial through the places of an interval. */
static inline void hopopt_at(const hopopt_phase *p, hopopt_real t, hopopt_real *q, hopopt_real *v) {
    t = hopopt_within(t, HOPOPT_R(0.0), hopopt_duration(p));
    const int k = hopopt_find(p->t, p->intervals, HOPOPT_TIMES, t + HOPOPT_EDGE), at = k * HOPOPT_TIMES;
    const hopopt_real place = (t - p->t[at]) / (p->t[at + HOPOPT_TIMES - 1] - p->t[at]);
    hopopt_real weight[HOPOPT_PLACES], sum = HOPOPT_R(0.0);
    for (int i = 0; i < HOPOPT_PLACES; i++) {
        const hopopt_real gap = place - hopopt_places[i];
        if (gap == HOPOPT_R(0.0)) {
            memset(weight, 0, sizeof weight);
            weight[i] = sum = HOPOPT_R(1.0);
            break;
        }
        sum += weight[i] = hopopt_weights[i] / gap;
    }
    for (int j = 0; j < HOPOPT_JOINTS; j++) {
        q[j] = v[j] = HOPOPT_R(0.0);
        for (int i = 0; i < HOPOPT_PLACES; i++) {
            const int from = (k * HOPOPT_PLACES + i) * HOPOPT_JOINTS + j;
            q[j] += weight[i] / sum * p->q[from];
            v[j] += weight[i] / sum * p->v[from];
        }
    }
}

/* Integral of a joint's planned torque from the phase's beginning to t [s]. Over the last short span of a phase its
   rounding counts: the operations and their order are those of the Python tracker. */
static inline hopopt_real hopopt_impulse(const hopopt_phase *p, hopopt_real t, int joint) {
    const int last = p->intervals * HOPOPT_TIMES - 1;
    const int k = hopopt_find(p->t, last + 1, 1, t), next = k < last ? k + 1 : last;
    const hopopt_real here = p->impulse[k * HOPOPT_JOINTS + joint], there = p->impulse[next * HOPOPT_JOINTS + joint];
    const hopopt_real span = p->t[next] - p->t[k];
    return span > HOPOPT_R(0.0) ? (there - here) / span * (t - p->t[k]) + here : here;
}

/* q, v now, and the torque whose impulse over the next period is the plan's. */
static inline void hopopt_planned(const hopopt_phase *p, hopopt_real since, hopopt_real *q, hopopt_real *v, hopopt_real *tau) {
    const hopopt_real end = hopopt_duration(p), from = hopopt_within(since, HOPOPT_R(0.0), end);
    const hopopt_real to = hopopt_within(since + HOPOPT_PERIOD, HOPOPT_R(0.0), end);
    hopopt_at(p, since, q, v);
    for (int j = 0; j < HOPOPT_JOINTS; j++) {
        if (since > end) v[j] = tau[j] = HOPOPT_R(0.0);
        else if (to - from >= HOPOPT_EDGE) tau[j] = (hopopt_impulse(p, to, j) - hopopt_impulse(p, from, j)) / (to - from);
        else tau[j] = p->ends[j];
    }
}

/* A torque [N m] brought within the joint's cap on power and its operating region at speed w [rad/s]. */
static inline hopopt_real hopopt_clamp(int joint, hopopt_real w, hopopt_real tau) {
    if (fabs(tau * w) > hopopt_power[joint]) tau = copysign(hopopt_power[joint] / fabs(w), tau);
    hopopt_real high = INFINITY, low = -INFINITY;
    for (int k = 0; k < HOPOPT_LINES; k++) {
        high = fmin(high, hopopt_upper[joint][k][0] - hopopt_upper[joint][k][1] * w);
        low = fmax(low, hopopt_lower[joint][k][0] - hopopt_lower[joint][k][1] * w);
    }
    return low <= high ? fmin(fmax(tau, low), high) : HOPOPT_R(0.0);
}

/* What a reading tells [rad] that is so far from what was expected: nothing within half a step of the encoder, which rounds
   alike as long as the joint rests; the more, the more of a step it turns in a period at its planned speed v. */
static inline hopopt_real hopopt_missed(hopopt_real apart, hopopt_real v) {
    const hopopt_real resting = HOPOPT_R(1.0) - fmin(HOPOPT_R(1.0), fabs(v) * HOPOPT_PERIOD / HOPOPT_STEP);
    return apart - resting * hopopt_within(apart, -HOPOPT_STEP / 2, HOPOPT_STEP / 2);
}

/* Torque [N m] at a joint and its rotor, of its motor's torque at joint speed w [rad/s]; and the inverse. spun: what of it
   spins the rotor up [N m]. */
static inline hopopt_real hopopt_passed(int joint, hopopt_real w, hopopt_real motor, hopopt_real spun) {
    const hopopt_real eta = hopopt_efficiency[joint], slow = hopopt_slow[joint], sharp = hopopt_sharp[joint];
    const hopopt_real turning = w / pow(pow(w, HOPOPT_R(4.0)) + pow(slow, HOPOPT_R(4.0)), HOPOPT_R(0.25));
    const hopopt_real up = pow(eta, -turning), c1 = (up + HOPOPT_R(1.0) / up) / HOPOPT_R(2.0), c2 = (up - HOPOPT_R(1.0) / up) / HOPOPT_R(2.0);
    const hopopt_real y = motor - spun - hopopt_friction[joint] * turning - hopopt_damping[joint] * w;
    return spun + c1 * y - c2 * sqrt(y * y + sharp * sharp);
}

static inline hopopt_real hopopt_needed(int joint, hopopt_real w, hopopt_real tau, hopopt_real spun) {
    const hopopt_real eta = hopopt_efficiency[joint], slow = hopopt_slow[joint], sharp = hopopt_sharp[joint];
    const hopopt_real turning = w / pow(pow(w, HOPOPT_R(4.0)) + pow(slow, HOPOPT_R(4.0)), HOPOPT_R(0.25)), out = tau - spun;
    const hopopt_real up = pow(eta, -turning), c1 = (up + HOPOPT_R(1.0) / up) / HOPOPT_R(2.0), c2 = (up - HOPOPT_R(1.0) / up) / HOPOPT_R(2.0);
    const hopopt_real lost = c2 * sqrt(out * out + sharp * sharp) + hopopt_friction[joint] * turning;
    return spun + c1 * out + lost + hopopt_damping[joint] * w;
}

/* y += sign M x, with M (rows, columns) row by row. */
static inline void hopopt_add(hopopt_real *y, hopopt_real sign, const hopopt_real *M, int rows, int columns, const hopopt_real *x) {
    for (int i = 0; i < rows; i++)
        for (int j = 0; j < columns; j++) y[i] += sign * M[i * columns + j] * x[j];
}

/* How fast drives turn, behind their gears, by their joints' speeds, of which belts, rods and cranks make more than one of the joint's
   own: d theta / d q row by row, and how the ratios of the joints' own laws change [1/rad]. Elsewhere both turn together. */
#if HOPOPT_COUPLED
typedef struct {
    hopopt_real turns[HOPOPT_JOINTS * HOPOPT_JOINTS], slopes[HOPOPT_JOINTS];
} hopopt_ratios;

/* Ratio of a joint's own law at an angle q [rad]: a cubic between the places of its table, straight beyond them. */
static inline hopopt_real hopopt_own_ratio(int joint, hopopt_real q, hopopt_real *slope) {
    const int first = hopopt_law[joint], last = hopopt_law[joint + 1] - 1;
    const hopopt_real *at = hopopt_law_angle, *ratio = hopopt_law_ratio, *rise = hopopt_law_slope;
    if (q <= at[first] || q >= at[last]) {
        const int end = q <= at[first] ? first : last;
        *slope = rise[end];
        return ratio[end] + rise[end] * (q - at[end]);
    }
    const int i = first + hopopt_find(at + first, last - first + 1, 1, q);
    const hopopt_real h = at[i + 1] - at[i], s = (q - at[i]) / h, up = ratio[i + 1] - ratio[i];
    const hopopt_real d0 = rise[i] * h, d1 = rise[i + 1] * h;
    const hopopt_real curve = HOPOPT_R(3.0) * up - HOPOPT_R(2.0) * d0 - d1, twist = d0 + d1 - HOPOPT_R(2.0) * up;
    *slope = (d0 + s * (HOPOPT_R(2.0) * curve + HOPOPT_R(3.0) * s * twist)) / h;
    return ratio[i] + s * (d0 + s * (curve + s * twist));
}

static inline void hopopt_ratios_at(const hopopt_real *q, hopopt_ratios *r) {
    memcpy(r->turns, hopopt_coupling, sizeof r->turns);
    for (int j = 0; j < HOPOPT_JOINTS; j++) r->turns[j * HOPOPT_JOINTS + j] += hopopt_own_ratio(j, q[j], &r->slopes[j]);
}

/* Speeds of the joints become those of the drives; torques of the drives those of the joints. */
static inline void hopopt_drive_speeds(const hopopt_ratios *r, hopopt_real *v) {
    hopopt_real w[HOPOPT_JOINTS] = {0};
    hopopt_add(w, HOPOPT_R(1.0), r->turns, HOPOPT_JOINTS, HOPOPT_JOINTS, v);
    memcpy(v, w, sizeof w);
}
static inline void hopopt_joint_torques(const hopopt_ratios *r, hopopt_real *tau) {
    hopopt_real out[HOPOPT_JOINTS] = {0};
    for (int i = 0; i < HOPOPT_JOINTS; i++)
        for (int j = 0; j < HOPOPT_JOINTS; j++) out[i] += r->turns[j * HOPOPT_JOINTS + i] * tau[j];
    memcpy(tau, out, sizeof out);
}

/* Accelerations a of the joints at speeds v become those of what spins in front of the gears, over their ratios. */
static inline void hopopt_spins(const hopopt_ratios *r, const hopopt_real *v, hopopt_real *a) {
    hopopt_real out[HOPOPT_JOINTS];
    for (int j = 0; j < HOPOPT_JOINTS; j++) out[j] = r->slopes[j] * v[j] * v[j];
    hopopt_add(out, HOPOPT_R(1.0), r->turns, HOPOPT_JOINTS, HOPOPT_JOINTS, a);
    hopopt_add(out, HOPOPT_R(1.0), hopopt_housings, HOPOPT_JOINTS, HOPOPT_JOINTS, a);
    memcpy(a, out, sizeof out);
}

/* Torques of the joints become those of the drives: by elimination, its rows in the order of their size. */
static inline void hopopt_of_drives(const hopopt_ratios *r, hopopt_real *tau) {
    const int n = HOPOPT_JOINTS;
    hopopt_real M[HOPOPT_JOINTS][HOPOPT_JOINTS];
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) M[i][j] = r->turns[j * n + i];
    for (int k = 0; k < n; k++) {
        int best = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(M[i][k]) > fabs(M[best][k])) best = i;
        for (int j = 0; j < n; j++) {
            const hopopt_real kept = M[k][j];
            M[k][j] = M[best][j], M[best][j] = kept;
        }
        const hopopt_real kept = tau[k];
        tau[k] = tau[best], tau[best] = kept;
        for (int i = k + 1; i < n; i++) {
            const hopopt_real share = M[i][k] / M[k][k];
            for (int j = k; j < n; j++) M[i][j] -= share * M[k][j];
            tau[i] -= share * tau[k];
        }
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int j = i + 1; j < n; j++) tau[i] -= M[i][j] * tau[j];
        tau[i] /= M[i][i];
    }
}

/* The same at measured joint angles q [rad], for what commands the motors. */
static inline void hopopt_drive_torques(const hopopt_real *q, hopopt_real *tau) {
    hopopt_ratios r;
    hopopt_ratios_at(q, &r);
    hopopt_of_drives(&r, tau);
}
#else
typedef struct {
    char none;
} hopopt_ratios;
static inline void hopopt_ratios_at(const hopopt_real *q, hopopt_ratios *r) { (void)q, r->none = 0; }
static inline void hopopt_drive_speeds(const hopopt_ratios *r, hopopt_real *v) { (void)r, (void)v; }
static inline void hopopt_joint_torques(const hopopt_ratios *r, hopopt_real *tau) { (void)r, (void)tau; }
static inline void hopopt_spins(const hopopt_ratios *r, const hopopt_real *v, hopopt_real *a) { (void)r, (void)v, (void)a; }
static inline void hopopt_of_drives(const hopopt_ratios *r, hopopt_real *tau) { (void)r, (void)tau; }
static inline void hopopt_drive_torques(const hopopt_real *q, hopopt_real *tau) { (void)q, (void)tau; }
#endif

/* What spins the rotors up over the next period (n) [N m], at planned speeds v: it never passes the gears' teeth. */
static inline void hopopt_spun(const hopopt_phase *p, hopopt_real since, const hopopt_ratios *r, const hopopt_real *v, hopopt_real *spun) {
    hopopt_real q[HOPOPT_JOINTS], now[HOPOPT_JOINTS], then[HOPOPT_JOINTS];
    hopopt_at(p, since, q, now);
    hopopt_at(p, since + HOPOPT_PERIOD, q, then);
    for (int j = 0; j < HOPOPT_JOINTS; j++) spun[j] = (then[j] - now[j]) / HOPOPT_PERIOD;
    hopopt_spins(r, v, spun);
    for (int j = 0; j < HOPOPT_JOINTS; j++) spun[j] *= hopopt_rotor[j];
}

/* y += sign M x, with M that of a control period; beyond the last the last. */
static inline void hopopt_add_at(hopopt_real *y, hopopt_real sign, const hopopt_phase *p, const hopopt_real *M, int period,
                                 int rows, int columns, const hopopt_real *x) {
    int low = 0, high = p->knots - 1;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (p->knot[middle] <= period) low = middle; else high = middle;
    }
    const int size = rows * columns, last = p->knot[high];
    const hopopt_real part = low == high || period >= last ? HOPOPT_R(1.0)
                             : HOPOPT_R(period - p->knot[low]) / HOPOPT_R(last - p->knot[low]);
    if (part < HOPOPT_R(1.0)) hopopt_add(y, sign * (HOPOPT_R(1.0) - part), M + low * size, rows, columns, x);
    if (part > HOPOPT_R(0.0)) hopopt_add(y, sign * part, M + high * size, rows, columns, x);
}

/* Errors from the planned flight's q and v at the first instant t off the ground, where it has been for ``since`` [s]: speeds
   differ as in stance, by an early lift-off, and by the torque that was held on; angles have gone on at the mean speed. */
static inline void hopopt_let_go(const hopopt_tracker *s, hopopt_real t, hopopt_real since, const hopopt_real *q, const hopopt_real *v,
                                 hopopt_real *error) {
    const int n = HOPOPT_JOINTS;
    const hopopt_real until = hopopt_within(since, HOPOPT_R(0.0), hopopt_duration(&hopopt_flight));
    hopopt_real left_q[HOPOPT_JOINTS], left_v[HOPOPT_JOINTS], first_q[HOPOPT_JOINTS], first_v[HOPOPT_JOINTS], mean[HOPOPT_JOINTS], held[HOPOPT_JOINTS];
    hopopt_at(&hopopt_stance, t - since - s->began, left_q, left_v);
    hopopt_at(&hopopt_flight, HOPOPT_R(0.0), first_q, first_v);
    for (int j = 0; j < n; j++) {
        mean[j] = hopopt_flight.begins[j];
        if (until >= HOPOPT_EDGE)
            mean[j] = (hopopt_impulse(&hopopt_flight, until, j) - hopopt_impulse(&hopopt_flight, HOPOPT_R(0.0), j)) / until;
        held[j] = (s->given[j] - mean[j]) * (since / HOPOPT_PERIOD);
        error[n + j] = s->error[n + j] + (left_v[j] - first_v[j]);
    }
    hopopt_add(error + n, HOPOPT_R(1.0), hopopt_flight.B + n * n, n, n, held);
    for (int j = 0; j < n; j++)
        error[j] = s->q[j] + (t - s->t) * (s->v[j] + v[j] + error[n + j]) / 2 - q[j];
}

/* Joint torques tau [N m] to ask of the drives for the next period; hopopt_drive_torques makes of them those of drives that do not turn as
   their joints do, behind their gears.

   t: since the first hop began [s]    q, v: measured joint angles [rad] and speeds [rad/s]; the filter uses q alone
   contact: whether the foot is on the ground        since: how long it has been on it, or off it [s]
   landings: how often it has landed; from the first on the leg stands as at the start, or hops on if the plan repeats. Then t
   may begin anew with hopopt_reset at a touchdown, landings 0, so that it stays small for its single precision */
static inline void hopopt_torque(hopopt_tracker *s, hopopt_real t, const hopopt_real *q, const hopopt_real *v, int contact,
                                 hopopt_real since, int landings, hopopt_real *tau) {
    const int n = HOPOPT_JOINTS, m = HOPOPT_STATES;
    const hopopt_real stance = hopopt_duration(&hopopt_stance);
    hopopt_real planned_q[HOPOPT_JOINTS], planned_v[HOPOPT_JOINTS], planned_tau[HOPOPT_JOINTS], spun[HOPOPT_JOINTS];
    hopopt_ratios ratios;
    contact = contact != 0;
    const int over = landings && !HOPOPT_REPEATS;
    if (contact && over) {
        for (int j = 0; j < n; j++) tau[j] = HOPOPT_K_P * (hopopt_rest[j] - q[j]) - HOPOPT_K_D * v[j];
        return;
    }
    if (!over) { /* a foot that comes off long before the planned lift-off has bounced: stance goes on */
        if (contact) s->lost = 0, s->began = t - since;
        const hopopt_real lasted = t - s->began;
        if (!contact && !s->lost) s->lost = 1, s->early = lasted < HOPOPT_EARLY * stance;
        if (contact || (s->early && lasted < stance)) contact = 1, since = lasted;
    }
    if (contact && since > HOPOPT_ENDS) {
        hopopt_at(&hopopt_flight, HOPOPT_R(0.0), planned_q, planned_v);
        memcpy(s->given, hopopt_flight.begins, sizeof s->given);
        hopopt_ratios_at(q, &ratios);
        hopopt_spun(&hopopt_flight, HOPOPT_R(0.0), &ratios, planned_v, spun);
        memcpy(tau, s->given, sizeof s->given);
        hopopt_drive_speeds(&ratios, planned_v);
        hopopt_of_drives(&ratios, tau);
        for (int j = 0; j < n; j++) tau[j] = hopopt_needed(j, planned_v[j], tau[j], spun[j]);
        hopopt_joint_torques(&ratios, tau);
        return;
    }
    const hopopt_phase *p = contact ? &hopopt_stance : &hopopt_flight;
    hopopt_planned(p, since, planned_q, planned_v, planned_tau);
    const hopopt_real nearest = nearbyint(since / HOPOPT_PERIOD);
    const int period = nearest < 30000 ? (int)nearest : 30000, ago = period > 0 ? period - 1 : 0; /* the period that led here */
    hopopt_real error[HOPOPT_STATES] = {0}, miss[HOPOPT_JOINTS];
    if (!s->known || (contact && !s->contact)) { /* no filter knows what speeds an impact leaves */
        for (int j = 0; j < n; j++) error[j] = hopopt_missed(q[j] - planned_q[j], planned_v[j]);
    } else if (s->contact == contact) {
        hopopt_add_at(error, HOPOPT_R(1.0), p, p->A, ago, m, m, s->error);
        hopopt_add_at(error, HOPOPT_R(1.0), p, p->B, ago, m, n, s->extra);
    } else {
        hopopt_let_go(s, t, since, planned_q, planned_v, error);
    }
    for (int j = 0; j < n; j++) miss[j] = hopopt_missed(q[j] - planned_q[j] - error[j], planned_v[j]);
    hopopt_add_at(error, HOPOPT_R(1.0), p, p->L, period, m, n, miss);
    for (int j = 0; j < n; j++) tau[j] = planned_tau[j];
    hopopt_add_at(tau, -HOPOPT_R(1.0), p, p->K, period, n, m, error);
    hopopt_ratios_at(planned_q, &ratios);
    hopopt_spun(p, since, &ratios, planned_v, spun);
    hopopt_real speeds[HOPOPT_JOINTS];
    for (int j = 0; j < n; j++) {
        s->q[j] = planned_q[j] + error[j];
        speeds[j] = s->v[j] = planned_v[j] + error[n + j];
    }
    hopopt_drive_speeds(&ratios, speeds);
    hopopt_drive_speeds(&ratios, planned_v);
    hopopt_of_drives(&ratios, tau);
    for (int j = 0; j < n; j++) {
        tau[j] = hopopt_clamp(j, speeds[j], hopopt_needed(j, planned_v[j], tau[j], spun[j]));
        s->given[j] = hopopt_passed(j, planned_v[j], tau[j], spun[j]);
    }
    hopopt_joint_torques(&ratios, tau);
    hopopt_joint_torques(&ratios, s->given);
    for (int j = 0; j < n; j++) s->extra[j] = s->given[j] - planned_tau[j];
    memcpy(s->error, error, sizeof error);
    s->t = t;
    s->known = 1;
    s->contact = contact;
}

#endif
